"""Printed in grey, the figures of allan, psd, identify, audit, design, regress and reproduce can be read too."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from testbed.allan import allan_deviation, fit_allan
from testbed.campaigns.regression import page as regression
from testbed.compensation.record import GyroRecord
from testbed.design.figure import pareto_figure
from testbed.design.search import Candidate, Design
from testbed.drift.figures import drift_figure, gain_figure, residual_allan_figure
from testbed.identification.figure import response_figure
from testbed.judging.allan_analysis import allan_figure, analyse
from testbed.judging.allan_records import RateRecord
from testbed.judging.density import estimate_density
from testbed.judging.density_figure import density_figure
from testbed.reproduce.paper1 import figures as paper1
from testbed.reproduce.paper2 import figures as paper2
from testbed.reproduce.paper3 import figures as paper3
from testbed.reproduce.paper3.page import _STYLES, _gain_figure
from testbed.sensors.noise import GyroNoise
from tests.report.grey import confused, style

FILTERS = ("kalman", "shakf", "arw_shakf", "wideband", "imm", "mine")


class Table(dict):
    """Any column that is asked for: positive, rising, another one for each name."""

    def __missing__(self, name):
        return np.geomspace(1.0, 10.0, 60) * (1.0 + len(self) + len(name))


@pytest.fixture(scope="module")
def rate():
    return GyroNoise(angle_random_walk=3e-5, rate_random_walk=5e-5).sample(4000, 100.0, 1)


def test_the_terms_of_an_allan_deviation_and_the_records_of_a_density(rate):
    assert confused(allan_figure([analyse(RateRecord("x", rate, 100.0, "x"))])) == []
    names = ("gx", "gy", "gz", "heading", "other")
    records = [RateRecord(name, (1.0 + k) * rate, 100.0, name) for k, name in enumerate(names)]
    records += [RateRecord(f, rate, 100.0, f, signal=f"fusion/{f}") for f in FILTERS]
    records += [RateRecord(s, rate, 100.0, s, signal=f"sensors/{s}") for s in ("mhd_ars", "mems_gyro", "fog")]
    assert confused(density_figure([estimate_density(record) for record in records])) == []


def test_the_responses_of_two_outputs():
    freq = np.geomspace(0.1, 100.0, 12)
    response = SimpleNamespace(
        freq_hz=freq,
        gain=np.ones(12),
        phase=np.zeros(12),
        half_widths=(np.full(12, 0.1), np.full(12, 0.1)),
        coherence=np.full(12, 0.99),
    )

    def one(name):
        return SimpleNamespace(
            name=name,
            measured=SimpleNamespace(response=response),
            model=SimpleNamespace(response=np.ones_like),
            floor=SimpleNamespace(freq_hz=freq, density=np.ones(12)),
            noise=SimpleNamespace(density=lambda _freq, gain: gain),
        )

    assert confused(response_figure([one(name) for name in ("mhd_ars", "mems_gyro", "fog", "mine")])) == []


def test_an_audit_and_the_page_of_paper_3(rate):
    curve = allan_deviation(rate, 100.0)
    quality = SimpleNamespace(curve=curve, fit=fit_allan(curve), fitted_to=1.0)
    names = ("record", "compensated", "equal low-pass", "oracle")
    assert confused(residual_allan_figure(dict.fromkeys(names, quality))) == []
    record = GyroRecord(rate, np.full(rate.size, 300.0), 1.0)
    assert confused(drift_figure(record, 0.5 * rate, rate)) == []
    gains = [SimpleNamespace(period=10.0**k, gain=0.9) for k in range(1, 6)]
    audit = SimpleNamespace(gains=gains, bandwidth_hz=0.01, step_gain=0.9, earth_gain=0.8, heat_gain=0.7)
    assert confused(gain_figure(audit)) == []
    styles = {str(k): style for k, style in enumerate(_STYLES)}
    assert confused(_gain_figure(dict.fromkeys(styles, audit), styles)) == []
    assert confused(residual_allan_figure(dict.fromkeys(styles, quality), styles)) == []


def test_the_candidates_of_a_design():
    made = [
        Candidate(("fog",), "blend", "tracker", f"mirror_{k}", float(k), {"residual_rms_urad": 9.0 / k}, met=k > 2)
        for k in range(1, 5)
    ]
    figure = pareto_figure(Design(tuple(made), {}), "residual_rms_urad", 4.0, "residual")
    looks = {
        text.get_text(): style(handle)
        for text, handle in zip(figure.legends[0].get_texts(), figure.legends[0].legend_handles, strict=True)
    }
    assert looks["is enough"] != looks["is not"]
    assert confused(figure) == []


def test_the_history_of_a_campaign(monkeypatch):
    found = [SimpleNamespace(name=name, over_optimum=1.0 + k) for k, name in enumerate(FILTERS)]
    monkeypatch.setattr(regression, "standings", lambda _rows, _moves: found)
    history = [{"entry": 1, "version": "1", "reason": "first", "campaign": "standard"}]
    assert confused(regression.history_figure(history, "standard")) == []


DRAWN = {
    **{name: lambda draw=draw: draw(Table()) for name, draw in paper1.DRAW.items()},
    "slip": lambda: paper1.draw_slip_error(Table()),
    "bode": lambda: paper1.draw_bode(Table(), Table()),
    "increments": lambda: paper1.draw_increments(Table(), Table()),
    "responses": lambda: paper2.draw_both_responses(Table()),
    "followed": lambda: paper2.draw_followed(Table()),
    "noise": lambda: paper2.draw_noise(Table()),
    "day": lambda: paper3.draw_day(Table()),
    "compensated": lambda: paper3.draw_compensated(Table.fromkeys(["time_h", *paper3.METHODS], np.arange(1.0, 9.0))),
    "deviations": lambda: paper3.draw_deviations(
        dict.fromkeys(["tau_s", *paper3.METHODS, "oracle"], np.arange(1.0, 9.0))
    ),
}


@pytest.mark.parametrize("name", DRAWN)
def test_the_figures_of_a_paper(name):
    assert confused(DRAWN[name]()) == []


def test_modes_and_their_entropies():
    found = paper3.Decomposed(
        np.random.default_rng(1).standard_normal((6, 800)),
        SimpleNamespace(noise=(0, 1), mixed=(2, 3), drift=(4, 5)),
        1.0,
    )
    assert confused(paper3.draw_modes(found)) == []
    columns = ("mode", "permutation_entropy", f"permutation_entropy_{paper3.SCALE}", f"sample_entropy_{paper3.SCALE}")
    assert confused(paper3.draw_entropies(dict.fromkeys(columns, np.arange(1.0, 6.0)), found)) == []
