"""Recordings that were joined into one run without a gap in the time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from bench import EFFECTS, EffectRequest, Noise, make_campaign
from identification.checks import check_runs
from identification.checks.campaign import admitted
from identification.checks.joined import divided, joints_of
from identification.ingest import Run, read_run
from identification.options import FitOptions

ROWS = 3000


def recording(seed: int, effects: tuple[str, ...] = ()) -> pd.DataFrame:
    """First training run of a campaign of a servo motor."""
    return make_campaign(21, effects, seed=seed, rows=ROWS).runs[0].frame


def fast_part(table: pd.DataFrame) -> int:
    """Sample of the largest speed in the middle of a recording."""
    speed = table["speed_rad_s"].to_numpy()
    return int(np.argmax(np.abs(speed[500:-500]))) + 500


def joined(table: pd.DataFrame, sample: int) -> pd.DataFrame:
    """A recording up to a sample, and another one of the opposite direction from there."""
    other = table.assign(
        voltage_V=-table["voltage_V"],
        current_A=-table["current_A"],
        speed_rad_s=-table["speed_rad_s"],
    )
    return pd.concat([table[:sample], other[sample:]], ignore_index=True)


def segments_of(run: Run) -> tuple[tuple[int, int], ...]:
    """Sample ranges of a run, divided at its joints."""
    return divided(run, joints_of(run)).segments


def codes(run: Run) -> list[str]:
    """Codes of all findings of a run."""
    return [finding.code for finding in check_runs([run]).findings]


@pytest.mark.parametrize("effects", [(), ("coulomb_friction", "brush_drop")])
def test_a_run_of_two_recordings_is_divided_at_the_joint(effects: tuple[str, ...]) -> None:
    """The speed jumps between two samples, and the back-EMF with it."""
    table = recording(1, effects)
    sample = fast_part(table)
    run = read_run(joined(table, sample))
    segments = ((0, sample), (sample, ROWS))
    assert "joined_recordings" in codes(run)
    assert segments_of(run) == segments
    assert admitted([run], [], FitOptions()).training[0].segments == segments


def test_a_whole_recording_is_not_divided() -> None:
    """With and without friction, at voltage steps of all sizes."""
    for seed in range(6):
        run = read_run(recording(seed, ("coulomb_friction",) if seed % 2 else ()))
        assert not joints_of(run)


def test_a_spike_of_the_speed_sensor_is_no_joint() -> None:
    """The speed returns with the next sample."""
    table = recording(1)
    speed = table["speed_rad_s"].to_numpy().copy()
    speed[fast_part(table)] *= -1.0
    table = table.assign(speed_rad_s=speed)
    run = read_run(table)
    assert not joints_of(run)


def test_a_sensor_that_fails_is_no_joint() -> None:
    """The speed reads zero for a while, but voltage and current show that the motor turns."""
    table = recording(1)
    fast = fast_part(table)
    table.loc[fast : fast + 20, "speed_rad_s"] = 0.0
    run = read_run(table)
    assert not joints_of(run)


@pytest.mark.parametrize("law", ["play", "more_play"])
def test_the_end_of_backlash_is_no_joint(law: str) -> None:
    """The shaft is struck, but the change of speed takes several samples."""
    for motor in range(6):
        requests = [EffectRequest("backlash", EFFECTS["backlash"].typical[1], law)]
        campaign = make_campaign(motor, requests, seed=motor, rows=1500)
        for run in campaign.runs:
            assert not joints_of(read_run(run.frame))


def test_spikes_of_a_slow_run_are_no_joints() -> None:
    """The regression follows the speed poorly, so that a spike has hardly a second residual."""
    for motor in range(6):
        campaign = make_campaign(motor, (), seed=motor, rows=1500, noise=Noise(kind="spiky"))
        for run in campaign.runs:
            assert not joints_of(read_run(run.frame))


@pytest.mark.parametrize(("jump", "count"), [(0.1, 0), (1.5, 1)])
def test_a_jump_that_a_current_could_make_is_no_joint(jump: float, count: int) -> None:
    """Motor without inductance, sampled five times in its time constant; its speeds are up to one.

    In a sample, the largest current changes the speed by a fifth of twice the largest speed.
    """
    rng = np.random.default_rng(0)
    voltage = np.repeat(rng.uniform(-1.0, 1.0, 40), 50)
    speed = np.zeros(voltage.size)
    share = np.exp(-0.2)
    for k in range(voltage.size - 1):
        speed[k + 1] = share * speed[k] + (1.0 - share) * voltage[k] + jump * (k == 945)
    noise = 1e-4 * rng.standard_normal((2, voltage.size))
    columns = {
        "time_s": 0.01 * np.arange(voltage.size),
        "voltage_V": voltage,
        "current_A": voltage - speed + noise[0],
        "speed_rad_s": speed + noise[1],
    }
    assert len(joints_of(read_run(pd.DataFrame(columns)))) == count


def test_a_run_without_joined_samples_has_no_joint() -> None:
    """Saturation at every second sample leaves no pair of neighbours."""
    run = read_run(recording(1))
    clipped = {"speed_rad_s": np.arange(run.rows) % 2 == 0}
    assert not joints_of(replace(run, clipped=clipped))


def test_one_jump_of_the_temperature_may_be_a_joint() -> None:
    """The motor stands still at the joint of recordings at two temperatures."""
    table = recording(1)
    warm = table["temperature_degC"].to_numpy() + 40.0 * (np.arange(ROWS) > ROWS // 2)
    (finding,) = check_runs([read_run(table.assign(temperature_degC=warm))]).findings
    assert finding.code == "jumping_temperature"
    assert "recordings were joined there" in finding.message


def test_a_joint_and_a_gap_give_three_segments() -> None:
    """A run that has gaps is divided in addition."""
    table = recording(1)
    sample = fast_part(table)
    table = joined(table, sample)
    table.loc[100:, "time_s"] += 1.0
    assert segments_of(read_run(table)) == ((0, 100), (100, sample), (sample, ROWS))
