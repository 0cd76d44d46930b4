"""Campaigns: many seeds and settings of a scenario, what they have in common computed once."""
