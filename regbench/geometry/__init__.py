"""Geometry that every room shares: SE(3), Kabsch, nearest neighbours, sizes of clouds."""
