"""Allan deviation of a rate record, where it has always been found; the mathematics is in `testbed.allan`."""

from testbed.allan import AllanCurve, AllanFit, Coefficient, Goodness, allan_deviation, fit_allan

__all__ = ["AllanCurve", "AllanFit", "Coefficient", "Goodness", "allan_deviation", "fit_allan"]
