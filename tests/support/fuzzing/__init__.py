"""Mutated files for every reader of untrusted data."""
