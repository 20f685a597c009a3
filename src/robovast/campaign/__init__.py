"""A campaign's folder: its layout, and the record and verdict of each run."""
