"""The air-bearing turntable: plant, servo, disturbances, and how it is integrated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.models.turntable.parameters import Mounting, TurntableParameters
from testbed.models.turntable.truth import TruthBlock

if TYPE_CHECKING:
    from testbed.models.turntable.turntable import Turntable

__all__ = ["Mounting", "TruthBlock", "Turntable", "TurntableParameters"]


def __getattr__(name: str) -> Any:
    # On demand: its parameters are read without MuJoCo.
    if name == "Turntable":
        from testbed.models.turntable.turntable import Turntable

        return Turntable
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)
