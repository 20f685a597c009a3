"""Campaigns that are started from the page: their commands, and the process that executes them."""
