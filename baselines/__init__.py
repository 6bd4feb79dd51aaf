"""Every method but LatentCEM, one module each."""
