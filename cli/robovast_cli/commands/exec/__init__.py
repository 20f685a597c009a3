"""`vast exec`."""
