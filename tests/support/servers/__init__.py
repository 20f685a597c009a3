"""Servers of the tests' own."""
