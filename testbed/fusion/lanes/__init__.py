"""Filters under many seeds side by side: what they share is computed once, the rest lane by lane."""
