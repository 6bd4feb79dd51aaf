"""What learned methods share (torch): layers, the training engine, the weight store. Nothing else loads it."""
