"""Datasets: prepared clouds on disk, memory-mapped, and `cad_demo`, which ships inside."""
