"""The page of `vast evaluation gui`: a server on this machine (extra `gui`)."""
