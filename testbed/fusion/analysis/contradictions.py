"""Findings about two sensors: sign, unit, gain, offset, rate, bandwidth and bias of one against the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from testbed.fusion.analysis.finding import QUANTILE, TOLERANCE, UNITS, Finding

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from testbed.fusion.analysis.agreement import Agreement, Pair
    from testbed.fusion.analysis.floor import NoiseRatio
    from testbed.fusion.belief import SensorBelief
    from testbed.signals import FloatArray

# What a belief's response may be off by, as a standard deviation [-]: of equation (39) and the channel it stands for,
# 1.9e-3 from 0.1 to 400 Hz. A phase of that much is an offset at a low frequency.
_MODEL = 2e-3
# What slow dynamics remember from before the record, as a share of the motion and a standard deviation [-]; poles
# slower than this remember a constant for longer than the ends are left out [rad/s].
_MEMORY, _SLOW = 5e-3, 1.0
# From here on the response of an octave, or the noise between bands, is not what is believed [-].
_DEPARTURE, _SLOPE = 0.05, 3.0
# How close a gain, or the noise of two odd units, is to a factor between units to be one, and what an odd unit must
# explain: logarithms.
_CLOSE, _ODD = 0.08, 0.7
# A mean is no bias below this [rad/s], and shows only through dynamics that pass a constant with at least this gain.
_LEAST_BIAS, _LEAST_SEEN = math.radians(0.01), 0.1


@dataclass(frozen=True)
class Names:
    """What a pair's findings are said of: what two sensors contradict in does not tell which is wrong.

    Parameters
    ----------
    noisy, clean : str
        The sensors.
    timed : bool
        Time and sign are said of the noisy one: it is the slower one, or as fast. The estimate stands at the stamps of
        the fastest sensor, and most of its band is that sensor's.
    scaled : bool
        The gain is said of the noisy one: the clean one sees a constant rate too, or it does not itself. A constant
        rate is what gains are calibrated by.
    """

    noisy: str
    clean: str
    timed: bool
    scaled: bool

    def of_time(self) -> tuple[str, str]:
        """Return the sensor whose time and sign are said, and the other one."""
        return (self.noisy, self.clean) if self.timed else (self.clean, self.noisy)

    def of_gain(self) -> tuple[str, str]:
        """Return the sensor whose gain is said, and the other one."""
        return (self.noisy, self.clean) if self.scaled else (self.clean, self.noisy)


def _factors(said: float) -> list[float]:
    """Return by what readings may be too large if they are in another unit than was said, `said` as of `Trace`: of
    rad/s nothing tells from what they were taken.
    """
    if said == 1.0:
        return [1.0, *UNITS.values(), *(1.0 / one for one in UNITS.values())]
    return [1.0, *(one / said for one in (1.0, *UNITS.values()) if not math.isclose(one, said, rel_tol=1e-6))]


def unit_factors(
    gain: float | None, noisy: NoiseRatio | None, clean: NoiseRatio | None, said: tuple[float, float] = (1.0, 1.0)
) -> tuple[float, float]:
    """Return by what the readings of two sensors are too large because of their units [-]: what explains their gain,
    and most of their noise, by the fewest odd units; 1 where no common motion gives a gain, since noise has any size.

    Parameters
    ----------
    gain : float or None
        Of the noisy sensor over the clean one [-], None if no motion shows in both.
    noisy, clean : NoiseRatio or None
        Noise of each over the believed one.
    said : tuple of float, optional
        The unit that was said of each, as of `Trace`.
    """
    if gain is None:
        return 1.0, 1.0
    loud = [0.0 if one is None else math.log(max(float(one.value[one.least]), 1e-300)) for one in (noisy, clean)]
    pairs = [(math.log(one), math.log(other)) for one in _factors(said[0]) for other in _factors(said[1])]
    # Two odd units take the noise of both for witness: a gain of one is no sign of any.
    pairs = [
        pair
        for pair in pairs
        if abs(math.log(gain) - pair[0] + pair[1]) < _CLOSE
        and (0.0 in pair or all(abs(u - r) < _CLOSE for u, r in zip(pair, loud, strict=True)))
    ] or [(0.0, 0.0)]

    def cost(pair: tuple[float, float]) -> float:
        return sum(abs(r - u) + _ODD * (u != 0.0) for u, r in zip(pair, loud, strict=True))

    best = min(pairs, key=cost)
    return math.exp(best[0]), math.exp(best[1])


def unit_findings(factors: Mapping[str, float], found: Agreement, said: Mapping[str, float]) -> Iterator[Finding]:
    """Yield readings in another unit than was said.

    Parameters
    ----------
    factors : mapping of str to float
        By what each sensor's are too large [-].
    found : Agreement
        Of the two.
    said : mapping of str to float
        The unit that was said of each, as of `Trace`.
    """
    for name, factor in factors.items():
        if factor == 1.0:
            continue
        wanted = _unit_name(said[name], "what was said")
        unit = _unit_name(factor * said[name], "")
        words = f"it reads in {unit}, not in {wanted}" if unit else "it reads in rad/s, not in what was said"
        half = math.exp(_CLOSE)
        if sum(one != 1.0 for one in factors.values()) == 1:
            half = 1.0 + _half(found)
        yield Finding(
            "unit", name, factor, factor / half, factor * half, "1", f"{words}: divide its readings by {factor:.6g}"
        )


def _unit_name(value: float, other: str) -> str:
    """Return the unit of which so many are 1 rad/s, `other` if it is none."""
    units = {"rad/s": 1.0, **UNITS}
    return next((text for text, one in units.items() if math.isclose(value, one, rel_tol=1e-6)), other)


def axis_finding(found: Agreement, names: Names) -> Finding:
    """Return that one sensor does not show the motion of the other.

    Parameters
    ----------
    found : Agreement
        Of the two.
    names : Names
        What it is said of.
    """
    (name, other), half = names.of_gain(), QUANTILE * math.sqrt(found.covariance[0, 0])
    words = (
        f"it and {other} do not show the same motion: other axes or mountings, times more than 0.5 s or clocks more "
        "than 1 % apart, or both far noisier than believed; compare the channels and their stamps"
    )
    return Finding("axis", name, found.gain, found.gain - half, found.gain + half, "1", words)


def sign_findings(found: Agreement, names: Names, unit: float) -> Iterator[Finding]:
    """Yield whether the readings of two sensors are of opposite sign.

    Parameters
    ----------
    found : Agreement
        Of the two.
    names : Names
        What the findings are said of.
    unit : float
        The part of the gain that is one between units [-].
    """
    if found.gain < 0.0:
        name, other = names.of_time()
        gain, half = found.gain / unit, _half(found)
        value = gain if names.timed else 1.0 / gain
        remedy = (
            f"it reads the opposite of {other}: turn its sign, or that of {other} if that one is wrong, which the two "
            "do not tell"
        )
        yield Finding("sign", name, -1.0, value * (1.0 + half), value * (1.0 - half), "1", remedy)


def gain_findings(found: Agreement, names: Names, unit: float) -> Iterator[Finding]:
    """Yield a gain that is not one.

    Parameters
    ----------
    found : Agreement
        Of the two.
    names : Names
        What the findings are said of.
    unit : float
        The part of the gain that is one between units [-].
    """
    name, other = names.of_gain()
    noisy = abs(found.gain) / unit
    value = noisy if names.scaled else 1.0 / noisy
    half = _half(found)
    if abs(value - 1.0) > max(TOLERANCE["gain"], half * value):
        remedy = f"divide its readings by {value:.5g}, or correct its scale; taken against {other}"
        yield Finding("gain", name, value, value * (1.0 - half), value * (1.0 + half), "1", remedy)


def time_findings(found: Agreement, names: Names, *, offset: bool) -> Iterator[Finding]:
    """Yield offset and rate of the stamps of one sensor against those of the other.

    Parameters
    ----------
    found : Agreement
        Of the two.
    names : Names
        What the findings are said of.
    offset : bool
        Whether an offset can be told from what is wrong with the belief.
    """
    name, other = names.of_time()
    half = QUANTILE * math.sqrt(found.covariance[2, 2])
    drifts = abs(found.rate) > max(TOLERANCE["rate"], half)
    # At the first stamp if the clocks drift apart; else what the middle says, given that they do not.
    at = np.array([1.0, -found.middle] if drifts else [1.0, -found.covariance[1, 2] / found.covariance[2, 2]])
    late = found.offset + at[1] * found.rate
    model = _MODEL / found.swing
    apart = QUANTILE * math.sqrt(float(at @ found.covariance[1:, 1:] @ at) + model**2)
    rate, late = (found.rate / (1.0 - found.rate), late / (1.0 - found.rate)) if names.timed else (-found.rate, -late)
    if drifts:
        remedy = (
            f"its stamps run {rate * 1e6:+.0f} ppm against those of {other}: give its true sample rate, or stamps of "
            "the same clock"
        )
        yield Finding("rate", name, rate, rate - half, rate + half, "1", remedy)
    if offset and abs(late) > max(TOLERANCE["offset"], apart):
        remedy = f"its stamps are late against {other}: take {late * 1e3:.3g} ms off them, or believe the delay"
        yield Finding("offset", name, late, late - apart, late + apart, "s", remedy)


def shape_findings(pair: Pair, found: Agreement, noise: NoiseRatio | None, names: Names) -> Iterator[Finding]:
    """Yield noise or a response that ends elsewhere than is believed.

    Parameters
    ----------
    pair : Pair
        The two sensors.
    found : Agreement
        Of the two.
    noise : NoiseRatio or None
        Of the noisy sensor, by bands.
    names : Names
        What the findings are said of.
    """
    if noise is not None and _sloped(noise):
        believed = np.sqrt(pair.noisy.reading_noise(noise.freq_hz))
        ends, wanted = (_end(noise.freq_hz, one) for one in (noise.value * believed, believed))
        step = math.sqrt(noise.freq_hz[1] / noise.freq_hz[0])
        said = f"its noise ends at {ends:.3g} Hz, and is believed to end at {wanted:.3g} Hz:"
        if ends == wanted:
            most, least = int(np.argmax(noise.value)), noise.least
            said = (
                f"its noise is {noise.value[most]:.3g} times the believed one at {noise.freq_hz[most]:.3g} Hz, and "
                f"{noise.value[least]:.3g} times at {noise.freq_hz[least]:.3g} Hz:"
            )
        if found.common and not _responds_otherwise(found):
            high, (lower, upper) = int(np.argmax(noise.value)), noise.interval(int(np.argmax(noise.value)))
            remedy = f"{said} its response is as believed, so raise output_noise of the belief"
            yield Finding("belief", names.noisy, float(noise.value[high]), lower, upper, "1", remedy)
        else:
            remedy = f"{said} it is another sensor or its filter is set otherwise; believe what it is"
            yield Finding("bandwidth", names.noisy, ends, ends / step, ends * step, "Hz", remedy)
    elif found.common and found.departure > _DEPARTURE:
        name, other = names.of_time()
        remedy = (
            f"its response against that of {other} departs from the belief around there, by "
            f"{100 * found.departure:.0f} %: identify the two sensors"
        )
        at = found.departs_at
        yield Finding("bandwidth", name, at, at / math.sqrt(2.0), at * math.sqrt(2.0), "Hz", remedy)


def _responds_otherwise(found: Agreement) -> bool:
    """Return whether the response departs: over its octaves, or in gain and phase where the motion is."""
    std = QUANTILE * np.sqrt(np.diag(found.covariance))
    gain = abs(abs(found.gain) - 1.0) > max(_DEPARTURE, std[0])
    phase = found.swing * abs(found.offset) > max(_DEPARTURE, found.swing * std[1])
    return bool(gain or phase or found.departure > _DEPARTURE)


def _sloped(noise: NoiseRatio) -> bool:
    high, low = int(np.argmax(noise.value)), noise.least
    steep = noise.value[high] > _SLOPE * noise.value[low] > 0.0
    return bool(steep and noise.interval(high)[0] > noise.interval(low)[1])


def bias_findings(
    pair: Pair, found: Agreement, a: FloatArray, names: Names, factors: Mapping[str, float]
) -> Iterator[Finding]:
    """Yield a constant that one sensor reads and the other does not.

    Parameters
    ----------
    pair : Pair
        The two sensors.
    found : Agreement
        Of the two.
    a : ndarray, shape (n_time,)
        The noisy path put right [rad/s].
    names : Names
        What the findings are said of.
    factors : mapping of str to float
        By what each sensor's readings are too large because of their unit [-].
    """
    w = pair.grid.weight(pair.noisy, pair.clean)
    if not w.any():
        return
    gain = found.gain if found.common else 1.0
    # A constant of the noisy sensor passes the dynamics of the clean one, and the other way round.
    blind = not pair.noisy.belief.sees_constant or not pair.clean.belief.sees_constant
    of_noisy = pair.clean.belief.sees_constant and (not blind or not pair.noisy.belief.sees_constant)
    seen, through = (pair.noisy.belief, pair.clean.belief) if of_noisy else (pair.clean.belief, pair.noisy.belief)
    carried = through.numerator[-1] / through.denominator[-1]
    if abs(carried) < _LEAST_SEEN:
        return
    w = w / w.sum()
    value = float(w @ (a / gain - pair.c)) / carried * (1.0 if of_noisy else -1.0)
    # Whether what is constant was so before the record began is not known.
    level = _remembered(pair.noisy.belief) * abs(float(w @ pair.c))
    motion = math.hypot(_MEMORY * math.sqrt(float(w @ pair.c**2)), level) / abs(carried)
    apart = QUANTILE * math.hypot(pair.mean_std(w) / abs(carried), motion, seen.turn_on_bias)
    if abs(value) > factors[names.clean] * max(_LEAST_BIAS, apart):
        name, other = (names.noisy, names.clean) if of_noisy else (names.clean, names.noisy)
        remedy = f"it reads a constant that {other} does not: take it off, or believe a turn_on_bias of that size"
        yield Finding("bias", name, value, value - apart, value + apart, "rad/s", remedy)


def _remembered(belief: SensorBelief) -> float:
    """Return the part of a constant that passes by the slow poles [-], the first states of the realisation."""
    one = belief.realisation()
    n = np.count_nonzero(np.abs(np.linalg.eigvals(one.A)) < _SLOW)
    return float(abs(one.C[:n] @ np.linalg.solve(one.A[:n, :n], one.B[:n])))


def undecided_of(pair: Pair, found: Agreement, kinds: Collection[str], names: Names) -> Iterator[str]:
    """Yield what two sensors cannot decide in this record.

    Parameters
    ----------
    pair : Pair
        The two sensors.
    found : Agreement
        Of the two.
    kinds : collection of str
        What was found.
    names : Names
        What it is said of.
    """
    both = f"{names.noisy} and {names.clean}"
    if not found.common:
        yield f"{both}: sign, unit, gain, offset and rate: no motion shows in both"
    else:
        yield from _not_close(found, kinds, names)
        if math.isfinite(found.ambiguity):
            yield (
                f"{names.of_time()[0]}: a further offset of {found.ambiguity * 1e3:.0f} ms, or that and the other "
                "sign: the motion looks the same then"
            )
    for name, other in ((names.noisy, pair.clean), (names.clean, pair.noisy)):
        if not other.belief.sees_constant:
            yield f"{name}: bias: it alone sees a constant rate"


def _not_close(found: Agreement, kinds: Collection[str], names: Names) -> Iterator[str]:
    model, std = _MODEL / found.swing, np.sqrt(np.diag(found.covariance))
    apart = {
        "gain": _half(found),
        "offset": QUANTILE * math.hypot(std[1], model),
        "rate": QUANTILE * std[2],
    }
    shown = {"gain": (100.0, "%"), "offset": (1e3, "ms"), "rate": (1e6, "ppm")}
    for kind, half in apart.items():
        name = names.of_gain()[0] if kind == "gain" else names.of_time()[0]
        scale, unit = shown[kind]
        if "bandwidth" in kinds and kind != "rate":
            yield f"{name}: {kind}: the belief in the response is wrong"
        elif kind not in kinds and half > TOLERANCE[kind]:
            wanted = f"{scale * TOLERANCE[kind]:g} {unit}"
            yield f"{name}: {kind} to {wanted}: this motion tells it to {scale * half:.2g} {unit}"


def _half(found: Agreement) -> float:
    """Return half the relative interval of the gain."""
    return QUANTILE * math.hypot(math.sqrt(found.covariance[0, 0]) / abs(found.gain), _MODEL)


def _end(freq_hz: FloatArray, root_density: FloatArray) -> float:
    """Return up to where a density stays above half of its lowest band's [Hz]."""
    above = root_density**2 >= 0.5 * root_density[0] ** 2
    return float(freq_hz[above][-1])
