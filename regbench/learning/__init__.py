"""What learned methods share (torch): layers, the Chamfer distance, the weight store. Nothing else loads it."""
