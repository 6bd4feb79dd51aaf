"""Raw downloads to prepared data."""
