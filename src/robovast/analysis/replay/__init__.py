"""Compares replays with the run that they repeat."""
