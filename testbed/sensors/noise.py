"""Instrument noise after IEEE Std 952: two-sided densities in, rad/s out, the same statistics at any sample rate.

Every term draws from a random stream of its own, so switching one off leaves the others bit-identical, and keeps its
state, so any division into blocks gives the same bits.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from testbed.parts import Part
from testbed.sensors.noise_terms import (
    NoiseStage,
    Quantization,
    Ramp,
    White,
    continuous_flicker,
    flicker,
    markov,
    random_walk,
)
from testbed.sensors.sampled_noise import Rational, SampledNoise, Shape, sampled
from testbed.signals import BASE_RATE_HZ, random_stream
from testbed.units import (
    AngularAcceleration,
    Frequency,
    PositiveDuration,
    QuantizationAngle,
    RateDensity,
    RateRandomWalk,
    RateStd,
)

if TYPE_CHECKING:
    from testbed.sensors.noise_terms import NoiseTerm
    from testbed.signals import FloatArray


class GyroTerms(Part):
    """Noise coefficients of a gyro after IEEE Std 952, two-sided; zero switches a term off.

    Parameters
    ----------
    quantization : float
        Q, standard deviation of the angle error [rad]; S = (2 sin(pi f T) Q)^2 / T.
    angle_random_walk : float
        N [rad/sqrt(s)]; S = N^2.
    bias_instability : float
        B [rad/s]; true flicker, S = B^2 / (2 pi f) from `lowest_frequency` to half the sample rate, flat below.
    rate_random_walk : float
        K [rad/s^1.5], paper 1's ARRW; S = (K / 2 pi f)^2.
    rate_ramp : float
        R [rad/s^2].
    markov_bias : float
        sigma_b [rad/s] of paper 1's bias model, equation (22): a Markov process and no flicker.
    markov_time : float
        Its correlation time T_c [s].
    lowest_frequency : float
        Lower end of the flicker band [Hz].
    """

    quantization: QuantizationAngle = 0.0
    angle_random_walk: RateDensity = 0.0
    bias_instability: RateStd = 0.0
    rate_random_walk: RateRandomWalk = 0.0
    rate_ramp: AngularAcceleration = 0.0
    markov_bias: RateStd = 0.0
    markov_time: PositiveDuration = 100.0
    lowest_frequency: Frequency = 1e-4

    def noise_psd(self, freq_hz: FloatArray, sample_rate_hz: float | None = None) -> FloatArray:
        """Return the two-sided density of the sum of the random terms.

        Parameters
        ----------
        freq_hz : ndarray, shape (n_freq,)
            Frequency, above zero [Hz].
        sample_rate_hz : float, optional
            Sample rate, which the quantisation depends on [Hz]; without it that of continuous time, (2 pi f Q)^2 times
            50 us.

        Returns
        -------
        ndarray, shape (n_freq,)
            S(f) [rad^2/s].
        """
        turn = 2.0 * np.pi * freq_hz
        if sample_rate_hz is None:
            quantized = (turn * self.quantization) ** 2 / BASE_RATE_HZ
        else:
            quantized = (2.0 * np.sin(0.5 * turn / sample_rate_hz) * self.quantization) ** 2 * sample_rate_hz
        pink = self.bias_instability**2 / (2.0 * np.pi * np.maximum(freq_hz, self.lowest_frequency))
        lagged = 2.0 * self.markov_bias**2 * self.markov_time / (1.0 + (turn * self.markov_time) ** 2)
        density: FloatArray = (
            quantized + self.angle_random_walk**2 + pink + (self.rate_random_walk / turn) ** 2 + lagged
        )
        return density

    def slow_terms(self) -> dict[str, float]:
        """Return flicker and random walk, which a belief has under the same names."""
        return {
            "bias_instability": self.bias_instability,
            "rate_random_walk": self.rate_random_walk,
            "lowest_frequency": self.lowest_frequency,
        }

    def allan_variance(self, tau: float) -> float:
        r"""Return the expected Allan variance of the sum of the terms, the ramp included.

        .. math:: \frac{3 Q^2}{\tau^2} + \frac{N^2}{\tau} + \frac{2 \ln 2}{\pi} B^2 + \frac{K^2 \tau}{3}
            + \frac{R^2 \tau^2}{2} + \frac{2 \sigma_b^2 T_c}{\tau}
            \left[1 - \frac{T_c}{2 \tau} (3 - 4 e^{-\tau/T_c} + e^{-2 \tau/T_c})\right]

        Parameters
        ----------
        tau : float
            Averaging time, well inside the flicker's band [s].

        Returns
        -------
        float
            Variance [rad^2/s^2].

        References
        ----------
        IEEE Std 952-1997, annex C.
        """
        x = tau / self.markov_time
        lag = 1.0 + (4.0 * math.expm1(-x) - math.expm1(-2.0 * x)) / (2.0 * x)
        return (
            3.0 * self.quantization**2 / tau**2
            + self.angle_random_walk**2 / tau
            + 2.0 * math.log(2.0) / math.pi * self.bias_instability**2
            + self.rate_random_walk**2 * tau / 3.0
            + self.rate_ramp**2 * tau**2 / 2.0
            + 2.0 * self.markov_bias**2 / x * lag
        )

    def noise_terms(self, sample_rate_hz: float, seed: int, *names: str) -> dict[str, NoiseTerm]:
        """Return the terms that are not zero, each on the stream ``(*names, term)`` of `seed`.

        Parameters
        ----------
        sample_rate_hz : float
            Sample rate [Hz].
        seed : int
            Seed of the run.
        *names : str
            Owner of the streams, such as the sensor's name.

        Returns
        -------
        dict of str to NoiseTerm
            In the order of addition.
        """

        def stream(term: str) -> np.random.Generator:
            return random_stream(seed, *names, term)

        terms: dict[str, NoiseTerm] = {}
        if self.quantization:
            terms["quantization"] = Quantization(self.quantization, sample_rate_hz, stream("quantization"))
        if self.angle_random_walk:
            terms["angle_random_walk"] = White(self.angle_random_walk, sample_rate_hz, stream("angle_random_walk"))
        if self.bias_instability:
            source = stream("bias_instability")
            terms["bias_instability"] = flicker(self.bias_instability, self.lowest_frequency, sample_rate_hz, source)
        if self.rate_random_walk:
            terms["rate_random_walk"] = random_walk(self.rate_random_walk, sample_rate_hz, stream("rate_random_walk"))
        if self.rate_ramp:
            terms["rate_ramp"] = Ramp(self.rate_ramp, sample_rate_hz)
        if self.markov_bias:
            source = stream("markov_bias")
            terms["markov_bias"] = markov(self.markov_bias, self.markov_time, sample_rate_hz, source)
        return terms

    def shapes(self) -> dict[str, Shape]:
        """Return the random terms that are not zero in continuous time, flicker up to 20 kHz, Q at steps of 50 us."""
        shapes = {
            "quantization": Shape(white=self.quantization / math.sqrt(BASE_RATE_HZ), slope=True),
            "angle_random_walk": Shape(white=self.angle_random_walk),
            "rate_random_walk": Shape(poles=(0.0,), gains=(self.rate_random_walk,)),
            "markov_bias": Shape(
                poles=(1.0 / self.markov_time,), gains=(self.markov_bias * math.sqrt(2.0 / self.markov_time),)
            ),
        }
        if self.bias_instability:
            poles, gains = continuous_flicker(self.lowest_frequency, BASE_RATE_HZ)
            shapes["bias_instability"] = Shape(poles=tuple(poles), gains=tuple(self.bias_instability * gains))
        return {name: shape for name, shape in shapes.items() if getattr(self, name)}

    def sampled_terms(self, passed: Rational, sample_rate_hz: float, seed: int, *names: str) -> dict[str, NoiseTerm]:
        """Return the random terms behind a low-pass, as its readings have them; the ramp is not among them.

        Parameters
        ----------
        passed : Rational
            The low-pass.
        sample_rate_hz : float
            Rate of the readings [Hz].
        seed : int
            Seed of the run.
        *names : str
            Owner of the streams, such as the sensor's name.

        Returns
        -------
        dict of str to NoiseTerm
            In the order of addition, each on the stream ``(*names, term)``.
        """
        return {
            term: SampledNoise(sampled(shape, passed, sample_rate_hz), random_stream(seed, *names, term))
            for term, shape in self.shapes().items()
        }


class GyroNoise(GyroTerms):
    """The noise of a gyro by itself: `sample` for an array, `start` for a stream of blocks.

    Examples
    --------
    White noise of density N, sampled at interval T, has the standard deviation N / sqrt(T).

    >>> rate = GyroNoise(angle_random_walk=1e-4).sample(10_000, 100.0, rng=1)
    >>> round(float(rate.std()), 5)
    0.001
    """

    def start(self, sample_rate_hz: float, seed: int, *names: str) -> NoiseStage:
        """Return the noise in time.

        Parameters
        ----------
        sample_rate_hz : float
            Sample rate [Hz].
        seed : int
            Seed of the run.
        *names : str
            Owner of the random streams.

        Returns
        -------
        NoiseStage
            ``process(n)`` gives the next n samples [rad/s].
        """
        return NoiseStage(self.noise_terms(sample_rate_hz, seed, *names))

    def sample(self, n: int, sample_rate_hz: float, rng: int | np.random.Generator) -> FloatArray:
        """Return `n` samples of the sum of all terms.

        Parameters
        ----------
        n : int
            Number of samples.
        sample_rate_hz : float
            Sample rate [Hz].
        rng : int or numpy.random.Generator
            Seed, or a generator from which one is drawn.

        Returns
        -------
        ndarray, shape (n,)
            Noise [rad/s].

        Raises
        ------
        ValueError
            If `n` is negative, the sample rate not positive or the flicker band too short.
        """
        if n < 0:
            msg = f"n: expected at least 0, got {n}"
            raise ValueError(msg)
        if not (sample_rate_hz > 0.0 and math.isfinite(sample_rate_hz)):
            msg = f"sample_rate_hz: expected a positive number, got {sample_rate_hz}"
            raise ValueError(msg)
        seed = int(rng.integers(2**63)) if isinstance(rng, np.random.Generator) else rng
        return self.start(sample_rate_hz, seed).process(n)


class ElectronicTerms(Part):
    """White plus 1/f noise of an amplifier: S(f) = n^2 (1 + f_knee / f), two-sided.

    Parameters
    ----------
    noise_density : float
        n, two-sided root density of the white part, referred to the reading [rad/s/sqrt(Hz)].
    noise_knee : float, optional
        f_knee, where both parts are equal [Hz]; left out: no 1/f part.
    lowest_frequency : float
        Lower end of the 1/f part, flat below [Hz].
    """

    noise_density: RateDensity = 0.0
    noise_knee: Frequency | None = None
    lowest_frequency: Frequency = 1e-4

    def noise_psd(self, freq_hz: FloatArray) -> FloatArray:
        """Return the two-sided density at `freq_hz` [Hz], above zero, shape (n_freq,) [rad^2/s]."""
        knee = self.noise_knee or 0.0
        density: FloatArray = self.noise_density**2 * (1.0 + knee / np.maximum(freq_hz, self.lowest_frequency))
        return density

    def noise_terms(self, sample_rate_hz: float, seed: int, *names: str) -> dict[str, NoiseTerm]:
        """Return the white and the 1/f term, each on its own stream; arguments as `GyroTerms.noise_terms`."""
        if not self.noise_density:
            return {}
        terms: dict[str, NoiseTerm] = {
            "white": White(self.noise_density, sample_rate_hz, random_stream(seed, *names, "white"))
        }
        if self.noise_knee is not None:
            level = self.noise_density * math.sqrt(2.0 * math.pi * self.noise_knee)
            source = random_stream(seed, *names, "flicker")
            terms["flicker"] = flicker(level, self.lowest_frequency, sample_rate_hz, source)
        return terms
