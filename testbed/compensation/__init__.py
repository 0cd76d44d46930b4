"""Drift compensation of a fibre-optic gyro: decompositions, entropies, filters and regressions that know arrays only.

Nothing here knows a sensor model or the truth: what a compensator learns, it learns from readings of rate and temperature.
"""
