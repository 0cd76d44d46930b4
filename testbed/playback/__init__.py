"""Recordings played through the filters, and runs written as recordings."""
