"""Planning: from a Campaign object to the plan of its runs and their shards."""
