"""RPM-Net (Yew and Lee, CVPR 2020): soft matches of learned features, annealed by a network."""
