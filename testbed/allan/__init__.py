"""Allan deviation of a record: the curve, the coefficients of IEEE Std 952 in it, and what both are worth."""

from testbed.allan.curve import allan_deviation
from testbed.allan.fit import AllanFit, Coefficient, Goodness, fit_allan
from testbed.allan.octaves import AllanOctaves
from testbed.allan.types import AllanCurve

__all__ = ["AllanCurve", "AllanFit", "AllanOctaves", "Coefficient", "Goodness", "allan_deviation", "fit_allan"]
