"""Storage on the network: S3, HTTP servers, shares."""
