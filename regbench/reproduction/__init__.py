"""Doing again: what a run did, and what a paper printed."""
