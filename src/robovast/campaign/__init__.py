"""A campaign's folder: where what is, the record and the verdict of a run."""
