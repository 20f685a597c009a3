"""Minimises a failing run: the fewest list items and the mildest values that still fail."""
