"""A run, or a record, against what it should be."""
