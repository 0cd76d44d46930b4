"""The example from a data sheet to a sensor says what the sheet's keys become and what the readings then have."""

from __future__ import annotations

import re

import pytest

from tests.examples.programs import example


def test_it_prints_the_translation_and_the_noise_that_comes_of_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = example("data_sheet_to_sensor")
    monkeypatch.setattr(program, "SECONDS", 100)
    program.main()
    out = capsys.readouterr().out
    assert "rate_noise_density 5 mdps/√Hz (one-sided: over sqrt(2)) -> angle_random_walk: 0.212132 deg/sqrt(h)" in out
    # 0.0522 of white noise, 0.0022 of rounding and some 0.006 of flicker over 100 s.
    assert float(re.findall(r"rest: ([\d.]+) deg/s", out)[0]) == pytest.approx(0.0525, rel=0.03)
    assert "may be sqrt(2) too large" in out
