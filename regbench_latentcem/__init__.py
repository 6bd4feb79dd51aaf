"""LatentCEM (Jiang et al., IJCAI 2021): registration by planning with a learned latent dynamic model."""
