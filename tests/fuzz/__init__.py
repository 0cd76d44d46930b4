"""Hostile inputs by the thousand: `python -m tests.fuzz` plays them, a short form runs with the tests."""
