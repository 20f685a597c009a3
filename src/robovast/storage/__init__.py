"""Storage that is reached over a network: S3, HTTP servers, shares."""
