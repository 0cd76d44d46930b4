"""The document of a drift model: its schema, with a range for every number and a digest of the whole."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

if TYPE_CHECKING:
    from typing import Self

FORMAT, VERSION = "testbed drift model", 3

Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
_MOST_FEATURES = 64


def _between(least: float, most: float) -> Any:
    return Field(ge=least, le=most, allow_inf_nan=False)


# Standardised features, and powers of kelvin before; a drift of 1 rad/s would be no drift.
Feature = Annotated[float, _between(-1e6, 1e6)]
Power = Annotated[float, _between(-1e15, 1e15)]
Drift = Annotated[float, _between(-1.0, 1.0)]
Weight = Annotated[float, _between(-1e4, 1e4)]
Row = Annotated[list[Feature], Field(min_length=1, max_length=_MOST_FEATURES)]


class _Closed(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class FeaturesDocument(_Closed):
    """`Features` [s, K, K/s]."""

    degree: Annotated[int, Field(ge=1, le=9)]
    slopes: bool
    lags: Annotated[list[Annotated[float, _between(1e-3, 1e7)]], Field(max_length=20)]
    plays: Annotated[list[Annotated[float, _between(1e-6, 1e3)]], Field(max_length=20)]
    least_significant: Annotated[float, _between(1e-9, 100.0)]
    slope_error: Annotated[float, _between(1e-12, 100.0)]
    reference: Annotated[float, _between(1.0, 2000.0)]

    @property
    def n_feature(self) -> int:
        """Number of columns."""
        return self.degree + 2 * self.slopes + len(self.lags) + len(self.plays)


class ScalingDocument(_Closed):
    """`Scaling`, one number per feature."""

    mean: Annotated[list[Power], Field(min_length=1, max_length=_MOST_FEATURES)]
    scale: Annotated[list[Annotated[float, _between(1e-18, 1e15)]], Field(min_length=1, max_length=_MOST_FEATURES)]
    low: Row
    high: Row


class PolynomialDocument(_Closed):
    """`Polynomial` [rad/s]."""

    weights: Annotated[list[Weight], Field(min_length=1, max_length=_MOST_FEATURES)]
    bias: Drift


class LssvmDocument(_Closed):
    """`Lssvm` [-], [rad/s]."""

    support: Annotated[list[Row], Field(min_length=1, max_length=2000)]
    weights: Annotated[list[Weight], Field(min_length=1, max_length=2000)]
    bias: Drift
    width2: Annotated[float, _between(1e-9, 1e12)]


def _kind(machine: Any) -> str:
    return "lssvm" if isinstance(machine, dict) and "support" in machine else "polynomial"


Machine = Annotated[
    Annotated[PolynomialDocument, Tag("polynomial")] | Annotated[LssvmDocument, Tag("lssvm")], Discriminator(_kind)
]


class ModelDocument(_Closed):
    """A drift model as it stands in its file; SI, see `testbed.compensation.model_only.DriftModel`."""

    format: Literal["testbed drift model"]
    version: Literal[3]
    method: Literal["gradient", "lssvm", "polynomial", "process"]
    sample_rate_hz: Annotated[float, _between(1e-6, 1e6)]
    mean_rate: Annotated[float, _between(-1e3, 1e3)]
    blocked_error: Annotated[float, _between(0.0, 1e3)]
    starts: Annotated[list[Annotated[float, _between(1.0, 2000.0)]], Field(min_length=1, max_length=1000)]
    features: FeaturesDocument
    scaling: ScalingDocument
    machine: Machine
    trained_on: dict[Digest, Annotated[str, Field(max_length=300)]] = {}
    sha256: Digest

    @model_validator(mode="after")
    def _fits(self) -> Self:
        wanted, found = self.features.n_feature, self._sizes()
        wrong = [f"{name} {size}" for name, size in found.items() if size != wanted]
        if wrong:
            msg = f"expected {wanted} numbers for {wanted} features, got {', '.join(wrong[:5])}"
            raise ValueError(msg)
        if isinstance(self.machine, LssvmDocument) and len(self.machine.weights) != len(self.machine.support):
            msg = f"machine: expected a weight for each of {len(self.machine.support)} rows"
            raise ValueError(msg)
        if isinstance(self.machine, LssvmDocument) != (self.method == "lssvm"):
            msg = f"machine: expected that of method {self.method}"
            raise ValueError(msg)
        if any(low > high for low, high in zip(self.scaling.low, self.scaling.high, strict=True)):
            msg = "scaling: expected low at most high"
            raise ValueError(msg)
        return self

    def _sizes(self) -> dict[str, int]:
        found = {f"scaling.{name}": len(getattr(self.scaling, name)) for name in ("mean", "scale", "low", "high")}
        if isinstance(self.machine, PolynomialDocument):
            return {**found, "machine.weights": len(self.machine.weights)}
        return {**found, **{f"machine.support.{i}": len(row) for i, row in enumerate(self.machine.support)}}


def sealed(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document with the digest of everything else in it.

    Parameters
    ----------
    document : dict
        Plain lists and numbers.
    """
    return {**document, "sha256": seal_of(document)}


def seal_of(document: dict[str, Any]) -> str:
    """Return the SHA-256 of a document without its own digest, its keys in order.

    Parameters
    ----------
    document : dict
        Plain lists and numbers.
    """
    content = {key: value for key, value in document.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
