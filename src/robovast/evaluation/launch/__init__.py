"""Starts campaigns from the page."""
