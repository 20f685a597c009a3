"""Where results are that are not here: S3, HTTP servers, shares."""
