"""IDAM (Li et al., ECCV 2020): matches by a learned similarity matrix, points eliminated by learned scores."""
