"""Results on disk: the layout of a campaign, the verdict and the record of a run."""
