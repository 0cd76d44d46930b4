"""Every registered motion keeps the contract."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from testbed.models.motion import Motion
from testbed.models.motions import MOTIONS
from testbed.parts import resolve
from tests.examples.programs import example

OWN = example("own_motion").RingDown
MODELS = {name: resolve("motion", name, MOTIONS) for name in MOTIONS} | {"own_motion": OWN}
EXAMPLES = {name: model.example for name, model in MODELS.items()}

pytestmark = pytest.mark.contract


@pytest.fixture
def context(tmp_path):
    t = np.arange(0.0, 3.0, 0.01)
    rows = (f"{a!r},{b!r}" for a, b in zip(t.tolist(), np.sin(2 * np.pi * t).tolist(), strict=True))
    (tmp_path / "record.csv").write_text("t,w\n" + "\n".join(rows))
    return {"border": True, "folder": tmp_path}


def test_every_concrete_motion_is_registered():
    shipped = {kind for kind in Motion.__subclasses__() if kind.__module__.startswith("testbed.")}
    assert shipped <= set(MODELS.values())


@pytest.mark.parametrize("name", MODELS)
def test_motion_is_finite_repeatable_and_pure(name, context):
    motion = MODELS[name].model_validate(EXAMPLES[name], context=context)
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


@pytest.mark.parametrize("name", MODELS)
def test_motion_says_what_it_contains(name, context):
    motion = MODELS[name].model_validate(EXAMPLES[name], context=context)
    assert 0.0 <= motion.top_frequency() <= 60.0
    assert all(0.0 < line <= motion.top_frequency() for line in motion.lines())


@pytest.mark.parametrize("name", MODELS)
def test_motion_refuses_an_unknown_key(name, context):
    with pytest.raises(ValidationError, match="Extra inputs"):
        MODELS[name].model_validate({**EXAMPLES[name], "amplitood": "1 deg/s"}, context=context)


@pytest.mark.parametrize("name", MODELS)
def test_motion_survives_the_round_trip_through_its_resolved_form(name, context):
    model = MODELS[name]
    motion = model.model_validate(EXAMPLES[name], context=context)
    written = motion.model_dump(mode="json", context={"border": True}, exclude_none=True)
    assert model.model_validate(written, context=context) == motion


@pytest.mark.parametrize("name", [name for name in MODELS if EXAMPLES[name]])
def test_every_number_of_a_motion_changes_it(name, context):
    """A key that is silently ignored would leave the motion as it was."""
    model = MODELS[name]
    t = np.linspace(0.013, 1.9, 777)
    base = model.model_validate(EXAMPLES[name], context=context).start(2.0, np.random.default_rng(1))(t)
    for key, value in EXAMPLES[name].items():
        if isinstance(value, str) and value[0].isdigit():
            number, unit = value.split(" ", 1)
            changed = {**EXAMPLES[name], key: f"{1.1 * float(number)} {unit}"}
            assert not np.array_equal(
                model.model_validate(changed, context=context).start(2.0, np.random.default_rng(1))(t), base
            ), key


@pytest.mark.parametrize("name", MODELS)
def test_a_motion_that_does_not_draw_is_the_same_for_every_seed(name, context):
    """Many seeds share one truth where `draws` says so. To say more than that costs time only."""
    motion = MODELS[name].model_validate(EXAMPLES[name], context=context)
    t = np.linspace(0.0, 2.0, 1001)
    one, other = (motion.start(2.0, np.random.default_rng(seed))(t) for seed in (1, 2))
    assert motion.draws or np.array_equal(one, other)


@pytest.mark.parametrize("name", ["multisine", "platform_psd", "random", "reaction_wheel"])
def test_what_is_random_says_so_and_is(name, context):
    example = {**EXAMPLES[name], **({"phases": "random"} if name == "multisine" else {})}
    motion = MODELS[name].model_validate(example, context=context)
    t = np.linspace(0.0, 2.0, 1001)
    one, other = (motion.start(2.0, np.random.default_rng(seed))(t) for seed in (1, 2))
    assert motion.draws
    assert not np.array_equal(one, other)
