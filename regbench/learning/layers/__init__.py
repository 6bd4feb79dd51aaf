"""Layers and losses on point clouds, fast on CPU: edge convolutions, neighbours, the Chamfer distance."""
