"""The air-bearing turntable: plant, servo, disturbances, and how it is integrated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.models.turntable.parameters import Mounting, TurntableParameters

if TYPE_CHECKING:
    from testbed.models.turntable.turntable import TruthBlock, Turntable

__all__ = ["Mounting", "TruthBlock", "Turntable", "TurntableParameters"]


def __getattr__(name: str) -> Any:
    # On demand: its parameters are read without MuJoCo.
    if name in {"TruthBlock", "Turntable"}:
        from testbed.models.turntable import turntable

        return getattr(turntable, name)
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)
