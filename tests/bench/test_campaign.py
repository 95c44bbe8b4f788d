"""Campaigns: reproducible, and as a real bench would log them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench import MOTORS, NOISELESS, EffectRequest, Noise, make_campaign, random_motor
from bench.declared import fit_declared
from bench.excitation import EXCITATIONS, Pace, one_way
from bench.options import BenchOptions
from bench.sensors import NoiseKind, decimals_for, draw_noise, round_step


def test_table_spans_one_watt_to_ten_kilowatt_and_seven_decades_of_inertia() -> None:
    """The table covers the supported range, and all motors are consistent."""
    powers = [m.rated_torque * m.rated_speed for m in MOTORS.values()]
    inertias = [m.J for m in MOTORS.values()]

    assert len(MOTORS) >= 8
    assert min(powers) <= 1.0
    assert max(powers) >= 1e4
    assert max(inertias) / min(inertias) >= 1e7


@pytest.mark.parametrize("name", [name for name in MOTORS if name != "paper_motor"])
def test_rated_point_of_a_motor_obeys_its_own_parameters(name: str) -> None:
    """The rated voltage is Ra times the rated current plus the back-EMF at rated speed."""
    m = MOTORS[name]

    assert m.rated_voltage == pytest.approx(
        m.Ra25 * m.rated_current + m.Kt25 * m.rated_speed, rel=0.02
    )


def test_random_motors_cover_the_range_and_repeat_by_seed() -> None:
    """300 draws span six decades of inertia and L/R from below to far above one sample."""
    motors = [random_motor(seed) for seed in range(300)]

    inertias = np.array([m.J for m in motors])
    ratios = np.array([m.L / m.Ra25 / m.sample_interval for m in motors])
    assert inertias.max() / inertias.min() > 1e6
    assert ratios.min() < 0.15
    assert ratios.max() > 10.0
    assert random_motor(17) == motors[17]


def test_equal_arguments_give_equal_campaigns_and_another_seed_another() -> None:
    """Equal seeds give equal text, byte by byte."""
    first, second, other = (
        make_campaign("wiper_60w", ["brush_drop"], seed=seed, rows=200) for seed in (1, 1, 2)
    )

    assert [first.csv(run) for run in first.runs] == [second.csv(run) for run in second.runs]
    assert first.truth == second.truth
    assert first.csv(first.runs[0]) != other.csv(other.runs[0])


def test_campaign_equals_its_files(tmp_path: Path) -> None:
    """Reading the files gives the frames in memory, number by number."""
    campaign = make_campaign("servo_150w", seed=4, rows=200, position="absolute")

    paths = campaign.write(tmp_path)

    assert [path.name for path in paths] == [
        *(f"training_{k}.csv" for k in range(1, 6)),
        "validation_1.csv", "validation_2.csv", "truth.json",
    ]  # fmt: skip
    for run, path in zip(campaign.runs, paths, strict=False):
        pd.testing.assert_frame_equal(pd.read_csv(path), run.frame, rtol=1e-14)
    assert json.loads(paths[-1].read_text(encoding="utf-8")) == campaign.truth


def test_columns_are_the_canonical_ones() -> None:
    """The names are those of the contract; temperature and angle appear only if logged."""
    columns = ["time_s", "voltage_V", "current_A", "speed_rad_s", "temperature_degC"]

    plain = make_campaign("servo_150w", rows=50).runs[0].frame
    angle = make_campaign("servo_150w", rows=50, position="incremental").runs[0].frame
    blind = make_campaign("servo_150w", rows=50, logs_temperature=False).runs[0].frame

    assert list(plain.columns) == columns
    assert list(angle.columns) == [*columns, "position_rad"]
    assert list(blind.columns) == columns[:4]
    assert angle["position_rad"].iloc[0] == 0.0


@pytest.mark.parametrize("kind", ["white", "coloured", "spiky", "heavy"])
def test_noise_has_the_level_of_the_truth(kind: NoiseKind) -> None:
    """Logged minus true over 35,000 samples; coloured noise has fewer independent ones."""
    campaign = make_campaign("wiper_60w", seed=6, rows=5000, noise=Noise(kind=kind))

    for column, state in (("current_A", "current"), ("speed_rad_s", "speed")):
        gap = np.concatenate(
            [run.frame[column].to_numpy() - run.hidden.state(state) for run in campaign.runs]
        )
        assert gap.std() == pytest.approx(campaign.truth["noise"][column], rel=0.06)


def test_types_of_noise_differ_in_character_and_not_in_level() -> None:
    """Coloured noise has an autocorrelation of 0.9, spiky noise a kurtosis far above 3."""
    white, coloured, spiky = (
        draw_noise(100_000, 2.0, kind, np.random.default_rng(1))
        for kind in ("white", "coloured", "spiky")
    )

    assert [noise.std() for noise in (white, coloured, spiky)] == pytest.approx([2.0] * 3, rel=0.05)
    assert np.corrcoef(coloured[1:], coloured[:-1])[0, 1] == pytest.approx(0.9, abs=0.01)
    assert np.mean(white**4) / np.var(white) ** 2 == pytest.approx(3.0, abs=0.1)
    assert np.mean(spiky**4) / np.var(spiky) ** 2 > 20.0


def test_heavy_tailed_noise_is_a_student_t_of_its_level() -> None:
    """The median of |t| with 4 degrees of freedom is 0.7407; its variance is 2."""
    noise = draw_noise(100_000, 2.0, "heavy", np.random.default_rng(1))

    assert np.median(np.abs(noise)) == pytest.approx(2.0 * 0.7407 / np.sqrt(2.0), rel=0.02)
    assert noise.std() == pytest.approx(2.0, rel=0.05)


def test_unknown_type_of_noise_is_refused() -> None:
    """The message lists the known types."""
    with pytest.raises(ValueError, match="'pink'; expected white, coloured, spiky or heavy"):
        draw_noise(10, 1.0, "pink", np.random.default_rng(0))


def test_bench_without_noise_logs_the_hidden_states() -> None:
    """The logged values equal the states to the twelve decimals of the file."""
    run = make_campaign("servo_150w", rows=100, noise=NOISELESS).runs[2]

    assert run.frame["current_A"].to_numpy() == pytest.approx(
        run.hidden.state("current"), abs=1e-11
    )
    assert run.frame["voltage_V"].to_numpy() == pytest.approx(run.hidden.voltage, abs=1e-11)
    assert run.frame["temperature_degC"].to_numpy() == pytest.approx(run.temperature, abs=1e-11)


def test_temperatures_cover_the_span_and_the_hottest_run_is_not_the_last() -> None:
    """The training runs cover 25 to 120 degC, and a colder run follows the hottest."""
    for seed in range(8):
        runs = make_campaign("servo_150w", seed=seed, rows=60).training
        means = [run.temperature.mean() for run in runs]
        assert min(means) < 32.0
        assert max(means) > 112.0
        assert means[-1] < max(means)


def test_one_direction_keeps_the_motor_turning_forwards() -> None:
    """With a positive voltage, a motor without load never reverses."""
    campaign = make_campaign("wiper_60w", rows=1000, direction="forward")

    assert all(run.hidden.state("speed").min() > 0.0 for run in campaign.runs)


def test_runs_begin_in_motion_unless_standstill_is_requested() -> None:
    """The first true speeds are positive, or all zero."""
    moving = make_campaign("servo_150w", rows=50)
    resting = make_campaign("servo_150w", rows=50, moving_start=False)

    assert all(run.hidden.state("speed")[0] > 0.0 for run in moving.runs)
    assert not any(run.hidden.state("speed")[0] for run in resting.runs)


@pytest.mark.parametrize("rows", [40, 999, 6000])
@pytest.mark.parametrize("name", list(EXCITATIONS))
def test_excitation_fills_the_run_and_stays_within_one(name: str, rows: int) -> None:
    """Each row has a value between -1 and 1, and the values vary."""
    for pace in (Pace(0.05, 15.0), Pace(80.0, 80.0), Pace(2.0, 6.0)):
        shape = EXCITATIONS[name](rows, pace, np.random.default_rng(3))

        assert shape.shape == (rows,)
        assert np.abs(shape).max() <= 1.0 + 1e-12
        assert np.ptp(shape) > 0.2
        assert one_way(shape).min() >= 0.15 - 1e-12


def test_default_excitations_differ_between_runs_and_can_be_chosen() -> None:
    """Five training runs have five excitations, or the named ones in turn."""
    mixed = BenchOptions()
    chosen = BenchOptions(excitation=("chirp", "steps"))

    assert len({mixed.excitation_of(number) for number in range(5)}) == 5
    assert [chosen.excitation_of(number) for number in range(3)] == ["chirp", "steps", "chirp"]


@pytest.mark.parametrize("step", [0.00021, 0.0052, 0.05, 0.3, 1.0, 7.0])
def test_resolution_is_written_exactly_by_its_decimals(step: float) -> None:
    """The resolution is 1, 2 or 5 times a power of ten and unchanged by rounding."""
    rounded = round_step(step)

    assert step / 2.6 < rounded <= step
    assert round(37.0 * rounded, decimals_for(rounded)) == pytest.approx(37.0 * rounded, rel=1e-12)


def test_linear_hold_ramps_between_samples() -> None:
    """FOH differs from ZOH, and the effect `input_hold` with ZOH declared gives the FOH run."""
    held = make_campaign("servo_150w", rows=400, noise=NOISELESS, excitation=("ramps",))
    linear = make_campaign(
        "servo_150w", rows=400, noise=NOISELESS, excitation=("ramps",), hold="foh"
    )
    other = make_campaign(
        "servo_150w", ["input_hold"], rows=400, noise=NOISELESS, excitation=("ramps",)
    )

    assert (held.runs[0].frame - linear.runs[0].frame)["current_A"].abs().max() > 1e-3
    pd.testing.assert_frame_equal(linear.runs[0].frame, other.runs[0].frame)
    assert other.truth["hold"] == {"declared": "zoh", "true": "foh"}


def test_jitter_scatters_the_instants_and_logs_them_truly() -> None:
    """Intervals scatter by sqrt(2) times the jitter, and the fit reaches the noise."""
    campaign = make_campaign("servo_150w", seed=3, rows=2000, jitter=0.1)

    intervals = np.diff(campaign.runs[0].frame["time_s"].to_numpy()) / 1e-3
    assert intervals.min() > 0.0
    assert intervals.std() == pytest.approx(0.1 * np.sqrt(2.0), rel=0.1)
    assert fit_declared(campaign).held_out == pytest.approx(1.0, abs=0.03)


def test_sensors_clip_at_their_range() -> None:
    """No logged current exceeds half the rated current, although the true one does."""
    campaign = make_campaign("servo_150w", rows=400, sensor_range=0.5)

    assert max(run.frame["current_A"].abs().max() for run in campaign.runs) <= 0.5 * 4.2 + 0.005
    assert max(np.abs(run.hidden.state("current")).max() for run in campaign.runs) > 4.2


def test_lost_rows_leave_a_gap_in_time() -> None:
    """Ten missing rows leave one step of eleven intervals."""
    frame = make_campaign("servo_150w", rows=100, lost_rows=10).runs[0].frame

    steps = np.diff(frame["time_s"].to_numpy())
    assert len(frame) == 90
    assert steps.max() == pytest.approx(11e-3)
    assert np.median(steps) == pytest.approx(1e-3)


@pytest.mark.parametrize("effect", ["coulomb_friction", "speed_offset"])
def test_effect_of_the_validation_runs_leaves_the_training_runs_alone(effect: str) -> None:
    """The training runs equal those of the clean motor; the validation runs differ."""
    request = EffectRequest(effect, 0.05, role="validation")

    clean = make_campaign("servo_150w", seed=2, rows=200)
    changed = make_campaign("servo_150w", [request], seed=2, rows=200)

    for one, other in zip(clean.runs, changed.runs, strict=True):
        same = one.frame["speed_rad_s"].equals(other.frame["speed_rad_s"])
        assert same == (one.role == "training")
    assert changed.truth["effects"][0]["role"] == "validation"


def test_effect_of_all_runs_cannot_be_limited_to_some() -> None:
    """A delay is a property of the logger and not of a run."""
    with pytest.raises(ValueError, match="in all runs or in none"):
        make_campaign("servo_150w", [EffectRequest("channel_delay", 0.1, role="validation")])


def test_bench_without_voltage_logs_a_motor_that_coasts() -> None:
    """The true voltage is zero, and the speed has decayed at the end."""
    run = make_campaign("servo_150w", rows=500, amplitude=0.0).runs[0]

    assert not run.hidden.voltage.any()
    assert abs(run.hidden.state("speed")[-1]) < 1e-6
