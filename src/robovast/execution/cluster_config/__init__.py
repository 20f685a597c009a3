"""Kinds of clusters, where plugins look for their base class."""
