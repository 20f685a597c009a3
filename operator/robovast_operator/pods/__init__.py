"""From a plan to pods, and what pods say."""
