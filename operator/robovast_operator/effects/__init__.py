"""The operator's effects: every module here sends requests to the API server."""
