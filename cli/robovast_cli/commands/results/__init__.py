"""`vast results`."""
