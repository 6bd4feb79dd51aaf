"""Protocols: named, versioned problem sets."""
