"""`vast config`."""
