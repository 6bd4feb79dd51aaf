"""Feature-metric registration (Huang et al. 2020): features that a decoder can rebuild the cloud from, aligned."""
