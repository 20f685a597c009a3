"""Shares, where plugins look for their base class."""
