"""`vast exec cluster`."""
