"""Every registered motion keeps the contract."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.models.motion import Motion
from testbed.models.motions import MOTIONS
from testbed.parts import resolve

EXAMPLES = {
    "chirp": {"start_frequency": "1 Hz", "stop_frequency": "20 Hz", "rate": "1 deg/s"},
    "constant": {"rate": "1 deg/s"},
    "multisine": {"frequencies": ["1 Hz", "3 Hz"], "rate": "1 deg/s"},
    "platform_psd": {"spectrum": "olympus", "low": "10 Hz", "high": "50 Hz"},
    "random": {"psd": "1e-3 (deg/s)^2/Hz", "low": "10 Hz", "high": "50 Hz"},
    "reaction_wheel": {
        "speed": "600 rev/min",
        "harmonics": [{"number": 1, "coefficient": "13.7 g*cm^2"}, {"number": 5.2, "coefficient": "2 g*cm^2"}],
        "inertia": "25 kg*m^2",
        "modes": [{"frequency": "50 Hz", "damping": 0.01, "gain": 0.5}],
        "stop_speed": "300 rev/min",
        "ramp_time": "1.5 s",
    },
    "recorded": {"file": "record.csv", "time": {"column": "t", "unit": "s"}, "rate": {"column": "w", "unit": "deg/s"}},
    "sine": {"frequency": "10 Hz", "rate": "1 deg/s"},
    "static": {},
}

pytestmark = pytest.mark.contract


@pytest.fixture
def context(tmp_path):
    t = np.arange(0.0, 3.0, 0.01)
    rows = (f"{a!r},{b!r}" for a, b in zip(t.tolist(), np.sin(2 * np.pi * t).tolist(), strict=True))
    (tmp_path / "record.csv").write_text("t,w\n" + "\n".join(rows))
    return {"border": True, "folder": tmp_path}


def test_every_motion_has_an_example_here():
    assert set(EXAMPLES) == set(MOTIONS)


def test_every_concrete_motion_is_registered():
    registered = {resolve("motion", name, MOTIONS) for name in MOTIONS}
    ours = {part for part in Motion.__subclasses__() if part.__module__.startswith("testbed.")}
    assert ours <= registered


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_is_finite_repeatable_and_pure(name, context):
    motion = resolve("motion", name, MOTIONS).model_validate(EXAMPLES[name], context=context)
    t = np.linspace(0.0, 2.0, 1001)
    t.flags.writeable = False
    first = motion.start(2.0, np.random.default_rng(1))
    rate = first(t)
    assert rate.shape == t.shape
    assert np.isfinite(rate).all()
    assert np.array_equal(rate, first(t))
    assert np.array_equal(rate, motion.start(2.0, np.random.default_rng(1))(t))
    # A function of time, not of the block: any part of it gives the same bits.
    assert np.array_equal(first(t[333:700]), rate[333:700])


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_says_what_it_contains(name, context):
    motion = resolve("motion", name, MOTIONS).model_validate(EXAMPLES[name], context=context)
    assert 0.0 <= motion.top_frequency() <= 60.0
    assert all(0.0 < line <= motion.top_frequency() for line in motion.lines())


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_refuses_an_unknown_key(name, context):
    with pytest.raises(ValidationError, match="Extra inputs"):
        resolve("motion", name, MOTIONS).model_validate({**EXAMPLES[name], "amplitood": "1 deg/s"}, context=context)


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_survives_the_round_trip_through_its_resolved_form(name, context):
    model = resolve("motion", name, MOTIONS)
    motion = model.model_validate(EXAMPLES[name], context=context)
    written = motion.model_dump(mode="json", context={"border": True}, exclude_none=True)
    assert model.model_validate(written, context=context) == motion


@pytest.mark.parametrize("name", [name for name in MOTIONS if EXAMPLES[name]])
def test_every_number_of_a_motion_changes_it(name, context):
    """A key that is silently ignored would leave the motion as it was."""
    model = resolve("motion", name, MOTIONS)
    t = np.linspace(0.013, 1.9, 777)
    base = model.model_validate(EXAMPLES[name], context=context).start(2.0, np.random.default_rng(1))(t)
    for key, value in EXAMPLES[name].items():
        if isinstance(value, str) and value[0].isdigit():
            number, unit = value.split(" ", 1)
            changed = {**EXAMPLES[name], key: f"{1.1 * float(number)} {unit}"}
            assert not np.array_equal(
                model.model_validate(changed, context=context).start(2.0, np.random.default_rng(1))(t), base
            ), key
