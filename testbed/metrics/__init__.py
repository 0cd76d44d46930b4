"""Accumulators: arrays in, numbers out. Errors, consistency of claims, spectra."""
