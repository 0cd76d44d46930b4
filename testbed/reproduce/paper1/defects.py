"""Table II with defects switched on in the sensors: what each costs every filter, split into noise and belief error.

Every case starts from clean sensors: white noise only (and the words of the converters), gain and timing as believed.
The filters know of no defect: they keep the belief that they have without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.reproduce.paper1.runs import FILTERS, FusionProtocol, errors, outputs, presets
from testbed.runs.atomic import write_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from testbed.sensors.base import Sensor
    from testbed.signals import FloatArray

CLEAN: dict[str, dict[str, Any]] = {
    "mems_gyro": {"bias_instability": 0.0, "rate_random_walk": 0.0},
    "mhd_ars": {"noise_knee": None},
}
# The gyro has no dead time of its own: ten samples of the 20 kHz clock through its decimation filter are 0.5 ms.
_LATE = (*(0.0,) * 10, 1.0)
KNEE = {"mhd_ars": {"noise_knee": 10.0}}
GYRO = presets()["mems_gyro"].model_dump(include={"bias_instability", "rate_random_walk"})
CASES: dict[str, dict[str, dict[str, Any]]] = {
    "clean": {},
    "1/f knee 10 Hz (MHD)": KNEE,
    "bias instability (gyro)": {"mems_gyro": {"bias_instability": GYRO["bias_instability"]}},
    "rate random walk (gyro)": {"mems_gyro": {"rate_random_walk": GYRO["rate_random_walk"]}},
    "gain +1 % (MHD)": {"mhd_ars": {"scale_factor_error": 0.01}},
    "gain +1 % (gyro)": {"mems_gyro": {"scale_factor_error": 0.01}},
    "delay 0.5 ms (MHD)": {"mhd_ars": {"delay": 0.5e-3}},
    "delay 0.5 ms (gyro)": {"mems_gyro": {"fir": _LATE}},
    "all": {
        "mhd_ars": {**KNEE["mhd_ars"], "scale_factor_error": 0.01, "delay": 0.5e-3},
        "mems_gyro": {**GYRO, "scale_factor_error": 0.01, "fir": _LATE},
    },
}
COLUMNS = (
    "rmse_deg_s",
    "rmse_lowest_deg_s",
    "rmse_highest_deg_s",
    "rmse_aligned_deg_s",
    "belief_rmse_deg_s",
    "noise_rmse_deg_s",
    "closure",
    "loss_deg_s",
    "loss_belief_deg_s",
    "loss_noise_deg_s",
)


def sensors_of(case: str, *, noise: bool = True) -> dict[str, Sensor]:
    """Return the paper's sensors with the defects of a case.

    Parameters
    ----------
    case : str
        One of `CASES`.
    noise : bool
        Off: the gain and the timing of the case alone.
    """
    return {
        name: sensor.model_copy(update=CLEAN[name] | CASES[case].get(name, {}) | {"noise": noise})
        for name, sensor in presets().items()
    }


@dataclass(frozen=True)
class Split:
    r"""Error of one filter over the seeds, and its two parts.

    belief: the error of the same run without noise, which is what the wrong belief (and the filter's lag) alone forces.
    noise: what the noise adds to that estimate, sample by sample. For a linear filter both are independent, so that
    :math:`\mathrm{rmse}^2 \approx \mathrm{belief}^2 + \mathrm{noise}^2`; `closure` is the root of that sum over
    the rmse. A filter that adapts to the noise is another filter without it, and need not close.

    Parameters
    ----------
    rmse, aligned, noise : ndarray, shape (n_seed,)
        Of each seed [deg/s].
    belief : float
        Without noise [deg/s].
    """

    rmse: FloatArray
    aligned: FloatArray
    noise: FloatArray
    belief: float

    @property
    def closure(self) -> float:
        """Median of sqrt(belief^2 + noise^2) / rmse over the seeds [-]."""
        return float(np.median(np.hypot(self.belief, self.noise) / self.rmse))

    def row(self, clean: Split) -> tuple[float, ...]:
        """Return the values of `COLUMNS`; the loss against `clean` is shared by the squares, so that its parts add up
        to it as far as both close.

        Parameters
        ----------
        clean : Split
            The same filter and signal without defects.
        """
        rmse, before = float(np.median(self.rmse)), float(np.median(clean.rmse))
        noise, noise_before = float(np.median(self.noise)), float(np.median(clean.noise))
        # a - b = (a^2 - b^2) / (a + b), and the squares add.
        parts = [(x**2 - y**2) / (rmse + before) for x, y in ((self.belief, clean.belief), (noise, noise_before))]
        spread = float(self.rmse.min()), float(self.rmse.max()), float(np.median(self.aligned))
        return rmse, *spread, self.belief, noise, self.closure, rmse - before, *parts


def split(rate: FloatArray, signal: str, case: str, seeds: int, protocol: FusionProtocol) -> dict[str, Split]:
    """Return the error of every filter in one case, split.

    Parameters
    ----------
    rate : ndarray, shape (n_time,)
        True rate [rad/s].
    signal : str
        One of `SIGNALS`.
    case : str
        One of `CASES`.
    seeds : int
        Seeds 1 to this [-].
    protocol : FusionProtocol
        Times of a run.
    """
    quiet = outputs(rate, 0, sensors_of(case, noise=False))
    belief = errors(quiet, rate, signal, protocol)
    totals, noises = [], []
    for seed in range(1, seeds + 1):
        noisy = outputs(rate, seed, sensors_of(case))
        totals.append(errors(noisy, rate, signal, protocol))
        noises.append({name: _rms_deg(noisy[name] - quiet[name], rate.size, protocol) for name in FILTERS})
    return {
        name: Split(
            rmse=np.array([total[name][0] for total in totals]),
            aligned=np.array([total[name][1] for total in totals]),
            noise=np.array([noise[name] for noise in noises]),
            belief=belief[name][0],
        )
        for name in FILTERS
    }


def table_ii_defects(rates: Mapping[str, FloatArray], seeds: int, out: Path, protocol: FusionProtocol) -> Iterator[str]:
    """Write table_ii_defects.csv and yield it line by line: for every filter its RMSE, and the belief and noise part of
    it.

    Parameters
    ----------
    rates : mapping of str to ndarray, shape (n_time,)
        True rate of each signal [rad/s].
    seeds : int
        Seeds 1 to this; medians over them [-].
    out : Path
        Folder to write to.
    protocol : FusionProtocol
        Times of a run.

    Yields
    ------
    str
        One line.
    """
    lines = [f"case,signal,name,{','.join(COLUMNS)}"]
    yield ""
    yield f"Table II with defects: RMSE (belief error, noise error) in 1e-3 deg/s, median over {seeds} seed(s)"
    yield f"{'':32s}" + "".join(f"{name:>22s}" for name in FILTERS)
    for signal, rate in rates.items():
        clean: dict[str, Split] = {}
        for case in CASES:
            found = split(rate, signal, case, seeds, protocol)
            clean = clean or found
            for name in FILTERS:
                values = ",".join(f"{value:.9f}" for value in found[name].row(clean[name]))
                lines.append(f"{case},{signal},{name},{values}")
            yield f"{signal:8s}{case:24s}" + "".join(f"{_cell(found[name]):>22s}" for name in FILTERS)
    write_text(out / "table_ii_defects.csv", "\n".join(lines) + "\n")


def _cell(found: Split) -> str:
    rmse, noise = (1e3 * float(np.median(values)) for values in (found.rmse, found.noise))
    return f"{rmse:.1f} ({1e3 * found.belief:.1f}, {noise:.1f})"


def _rms_deg(difference: FloatArray, n_time: int, protocol: FusionProtocol) -> float:
    settled = difference[round(protocol.settle / protocol.duration * n_time) :]
    return float(np.rad2deg(np.sqrt(np.mean(settled**2))))
