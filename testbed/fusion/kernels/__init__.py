"""The compiled recursions of the filters."""
