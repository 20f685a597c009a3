"""Campaigns, runs, bags and notebooks, made for tests."""
