"""`vast evaluation`."""
