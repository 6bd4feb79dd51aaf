"""The training engine behind `regbench train`: recipe, loop, checkpoints, log, and the contract of a Trainable."""
