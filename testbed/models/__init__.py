"""Deterministic physics: commanded motion, turntable, MHD channel. No sample clocks of instruments, no noise."""
