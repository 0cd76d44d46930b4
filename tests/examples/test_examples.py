"""The example programs: what they compute is checked by hand, and they run from the command line."""

from __future__ import annotations

import importlib.util
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from testbed.models.mhd_channel.channel import MhdChannel
from testbed.models.mhd_channel.ring import ChannelRing

if TYPE_CHECKING:
    from types import ModuleType

EXAMPLES = Path(__file__).parents[2] / "examples"


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Data classes look their module up by name.
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


one_mode_error, design_channel = load("one_mode_error"), load("design_channel")


@pytest.mark.oracle
@pytest.mark.parametrize("field", [0.036, 0.1])
def test_one_mode_error_is_equation_6(field: float) -> None:
    freq = np.geomspace(1e-3, 1e3, 50)
    curves = one_mode_error.error_curves(field, freq)
    # a = pi^2 nu / l^2 + sigma B^2 / rho of mercury in 10 mm.
    a = np.pi**2 * 1.526e-3 / 13534.0 / 1e-4 + 1.04e6 * field**2 / 13534.0
    assert curves.rate == pytest.approx(a, rel=1e-12)
    np.testing.assert_allclose(curves.reading_one_mode, a / np.sqrt((2 * np.pi * freq) ** 2 + a**2), rtol=1e-9)


@pytest.mark.oracle
def test_one_mode_error_above_the_corner_is_the_stokes_layer() -> None:
    freq = np.array([100.0, 1000.0])
    curves = one_mode_error.error_curves(0.036, freq)
    nu, w = 1.526e-3 / 13534.0, 2 * np.pi * freq
    tail = 2 / 10e-3 * np.sqrt(nu / w)
    # Beside the tail there is a/w, 6 % of it at 100 Hz; a straight line would have fallen by 10 from one to the other.
    np.testing.assert_allclose(curves.reading, tail, rtol=0.07)
    assert curves.approximation[0] / curves.approximation[1] == pytest.approx(np.sqrt(10.0), rel=0.07)
    # What the docstring of `one_mode_response` says.
    assert one_mode_error.error_curves(0.036, np.geomspace(1e-3, 1.0, 200)).approximation.max() == pytest.approx(
        0.09, rel=0.03
    )


@pytest.mark.oracle
def test_a_design_is_what_the_formulas_give() -> None:
    template = MhdChannel(fluid="mercury", height=1e-3, field=0.1, closure="axial_field")
    ring = ChannelRing(width=6e-3, radius=15e-3)
    designs = design_channel.survey(template, ring, [0.3, 0.5], [4e-3, 15e-3])
    assert [(each.channel.field, each.channel.height) for each in designs] == [
        (0.3, 4e-3),
        (0.5, 4e-3),
        (0.3, 15e-3),
        (0.5, 15e-3),
    ]
    for each in designs:
        field, height = each.channel.field, each.channel.height
        assert each.emf_per_rate == pytest.approx(field * 6e-3 * 15e-3, rel=1e-12)
        assert each.hartmann_number == pytest.approx(field * height / 2 * np.sqrt(1.04e6 / 1.526e-3), rel=1e-12)
        braking = 1.04e6 * field**2 / 13534.0 / (2 * np.pi)
        # Viscosity raises the corner above the braking rate by the Stokes layer, 12 % at 4 mm and 0.3 T.
        assert 0.98 * braking < each.corner_freq_hz < 1.15 * braking
        assert each.row().split()[2] == f"{each.corner_freq_hz:.4g}"


@pytest.mark.parametrize("choice", [["--field", "0"], ["--height", "-1"], ["--load-fraction", "2"], ["--fluid", "tin"]])
def test_design_refuses_what_makes_no_sense(choice: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        design_channel.arguments(choice)
    assert stopped.value.code == 2
    assert "expected" in (message := capsys.readouterr().err) or "invalid choice" in message


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("one_mode_error", []),
        ("linear_range", []),
        ("design_channel", ["--fluid", "galinstan", "--closure", "radial_field", "--load-fraction", "0.5", "--figure"]),
    ],
)
def test_example_prints_and_draws(
    name: str, options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, program = tmp_path / "figure.png", EXAMPLES / f"{name}.py"
    monkeypatch.setattr("sys.argv", [str(program), *options, str(picture)])
    runpy.run_path(str(program), run_name="__main__")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert len(capsys.readouterr().out.splitlines()) > 8


def test_a_filter_just_switched_on_is_less_linear_than_a_settled_one() -> None:
    """Its gain of the gyro falls as 1/t from the whole band on: after 20 s 20 times narrower, so a factor of two is far
    inside.
    """
    program = load("paper2_linearity")
    short = replace(program.PAPER, linear_amplitudes=(10.0, 20.0, 30.0, 40.0, 50.0), linear_observe=2.0, settle=0.1)
    fresh, settled = (program.ratios(1, replace(short, warm_up=seconds)) for seconds in (0.0, 20.0))
    assert fresh.shape == (1,)
    assert fresh[0] > settled[0] > 0.0


def test_shaped_blends_compare_or_say_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = load("shaped_blends")
    monkeypatch.setattr(sys, "argv", ["shaped_blends.py", str(tmp_path / "figure.png")])
    monkeypatch.setattr(program.importlib.util, "find_spec", lambda _name: None)
    program.main()
    said = capsys.readouterr().out
    assert "python -m pip install slycot" in said
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    row = next(line for line in said.splitlines() if line.startswith("sx300 + adis16505_filtered"))
    one, two, three = (float(value) for value in row.replace(" dB", "").split()[3:9:2])
    assert two < 4.0
    assert one > 12.0
    # Two poles are three of which one is on a zero; no filter of any order has less than 3.6 dB.
    assert 3.5 < three < two


def test_synthesis_finds_nothing_much_nearer_to_the_bound() -> None:
    pytest.importorskip("slycot")
    program = load("shaped_blends")
    default = program.pair("adis16505_filtered", "sx300")
    L, norm = program.synthesised(default)
    # The weights are fitted within 0.6 dB.
    assert norm < default.excess(L).max() < 4.2
    assert norm - 0.6 < default.excess(program.shaped(default)).max() < norm + 0.6
