"""What happens to the results of campaigns on a cluster."""
