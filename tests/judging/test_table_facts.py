"""What is said of the turntable: modes, torque, how it followed, and the noise of its truth."""

from __future__ import annotations

import numpy as np
import pytest

import testbed
from testbed.chain.pipeline import simulate
from testbed.cli.terminal import print_metrics
from testbed.cli.understood import print_scenario
from testbed.judging.judge import Judge
from testbed.judging.table_facts import TableMetrics, table_facts, truth_noise
from testbed.models.motion import CommandBlock
from testbed.models.turntable.modes import coupled_modes
from testbed.models.turntable.parameters import TurntableParameters
from testbed.models.turntable.turntable import Turntable
from testbed.scenario.model import BASE_RATE_HZ
from testbed.scenario.step_choice import excerpt
from tests.scenes import short

DEG = np.pi / 180.0


def entry_of(scenario, block=1.0):
    _, blocks = simulate(scenario, block)
    metrics, parts = TableMetrics(scenario), []
    for part in blocks:
        metrics.write(part)
        parts.append(part)
    return metrics.result(), parts


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    scenario = short(tmp_path_factory.mktemp("scene"))
    return scenario, *entry_of(scenario)


def test_tracking_error_is_that_of_the_samples_after_settle(run):
    _, entry, (block,) = run
    for name, rate in (("encoder", block.truth.encoder_rate), ("inertial", block.truth.rate)):
        error = (rate - block.command.rate[:-1])[4000:] / DEG
        assert entry[f"command_to_{name}_rms_deg_s"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
        # Three whole periods of 10 Hz: the projection on a complex exponential is the least-squares fit.
        turn = np.exp(-2j * np.pi * 10.0 * np.arange(4000, 10_000) / BASE_RATE_HZ)
        ratio = (turn @ rate[4000:]) / (turn @ block.command.rate[4000:-1])
        (line,) = entry[f"command_to_{name}_lines"]
        assert line["gain"] == pytest.approx(abs(ratio), rel=1e-12)
        assert line["phase_deg"] == pytest.approx(np.angle(ratio, deg=True), rel=1e-6)
    # The recoil of the platform, 0.11 %, is in the inertial rate; the servo holds the encoder to the command.
    assert entry["command_to_inertial_rms_deg_s"] > 5 * entry["command_to_encoder_rms_deg_s"] > 0.0


def test_peak_torque_is_that_of_the_whole_run_and_below_what_was_required(run):
    scenario, entry, (block,) = run
    assert entry["peak_torque_nm"] == np.abs(block.truth.torque).max()
    # I w a and 2 mN m of cogging; the ramp-in adds to the derivative of the sine.
    bare = 0.05 * DEG * 2 * np.pi * 10.0
    assert bare < entry["peak_torque_nm"] < 1.5 * (bare + 2e-3)
    assert entry["peak_torque_nm"] < entry["required_torque_nm"] < 1.2 * entry["peak_torque_nm"]
    assert entry["torque_margin"] == pytest.approx(1 - entry["peak_torque_nm"] / 6.0, rel=1e-15)
    np.testing.assert_array_equal(entry["modes_hz"], coupled_modes(scenario.turntable)[0])


def test_metrics_do_not_depend_on_the_blocks(run):
    scenario, entry, _ = run
    other, _ = entry_of(scenario, 0.037)
    for key in ("command_to_encoder_rms_deg_s", "command_to_inertial_rms_deg_s"):
        assert other[key] == pytest.approx(entry[key], rel=1e-9)
    assert other["peak_torque_nm"] == entry["peak_torque_nm"]


def test_fixed_table_follows_exactly_and_knows_no_torque(tmp_path):
    entry, _ = entry_of(short(tmp_path, ("{preset: air_bearing}", "{mode: fixed}")))
    assert entry["command_to_encoder_rms_deg_s"] == entry["command_to_inertial_rms_deg_s"] == 0.0
    assert entry["command_to_encoder_lines"][0]["gain"] == 1.0
    assert entry["peak_torque_nm"] == entry["required_torque_nm"] == entry["truth_noise_deg_s"] == 0.0
    assert entry["torque_limit_nm"] is entry["torque_margin"] is None
    assert entry["modes_hz"] == []


def test_excerpt_is_the_motion_without_its_ramp_in(run):
    scenario, _, _ = run
    block = excerpt(scenario, 1234).process(100)
    t = np.arange(1234, 1335) / BASE_RATE_HZ
    np.testing.assert_allclose(block.rate, DEG * np.sin(2 * np.pi * 10.0 * t), rtol=0.0, atol=1e-14 * DEG)
    assert block.start == 0


@pytest.mark.parametrize("mode", ["servo", "ideal"])
def test_arithmetic_noise_of_the_truth(mode, run):
    scenario, _, _ = run
    noise = truth_noise(TurntableParameters(mode=mode), excerpt(scenario).process(2000))
    print(f"arithmetic noise of the truth, mode {mode}: {noise:.1e} rad/s rms")
    # An angle of a radian is known to eps; the servo's 133 Hz turns it into a rate, the bearing's 600 Hz at most.
    assert 0.0 < noise < np.finfo(float).eps * 2 * np.pi * 600.0


def test_static_floor_of_the_truth():
    rest = np.zeros(4001)
    truth = Turntable(TurntableParameters(), {}).process(CommandBlock(0, rest, rest, rest[1:], rest[1:]))
    floor = np.sqrt(np.mean(truth.rate**2))
    print(f"static floor of the truth: {floor:.1e} rad/s rms")
    # As in the turntable's own test: accelerations of 1e-13 rad/s^2 left by the equilibrium.
    assert floor < 1e-16


def test_facts_are_printed_before_and_after_the_run(run, tmp_path, capsys):
    scenario, _, _ = run
    print_scenario(scenario, table_facts(scenario))
    before = capsys.readouterr().out
    for words in ("coupled modes (damping): 1.4", "required torque 0.0", "of 6 N m, margin 9", "arithmetic noise"):
        assert words in before
    print_metrics(testbed.run(scenario).metrics, tmp_path)
    after = capsys.readouterr().out
    for words in ("turntable: command to encoder", "at 10 Hz), inertial", "peak torque", "margin 9"):
        assert words in after


def test_judge_hands_the_facts_on(run):
    scenario, entry, parts = run
    chain, _ = simulate(scenario)
    judge = Judge(scenario, chain.rates, chain.step)
    for part in parts:
        judge.write(part)
    assert judge.metrics()["turntable"] == entry
