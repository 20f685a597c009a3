"""What the operator does and looks at: every module here speaks to the API server."""
