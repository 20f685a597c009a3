"""Clusters, real and fake, and what is asked of them."""
