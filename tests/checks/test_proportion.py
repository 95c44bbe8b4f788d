"""Motors whose friction keeps current and speed in proportion: one run determines neither R nor K.

A wrong scale or sign in one run is then known from voltage per current, voltage per speed and the
mechanical time constant of the other runs.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.commands.arguments import mapping_of
from identification.checks import check_runs
from identification.checks.campaign import admitted
from identification.checks.consistency import estimate_of
from identification.ingest import Run, read_run
from identification.options import FitOptions
from tests.motors import Excitation, Motor, campaign, drive, motor_named, run_of

FOLDER = Path(__file__).parents[2] / "data" / "paper_motor"
PAPER = [read_run(FOLDER / f"training_{k}.csv") for k in range(1, 5)]
UNITS = {"voltage": "V", "current": "A", "speed": "rad_s"}
FAULTS = [
    ("speed", 30.0 / np.pi, "scaled_channel"),
    ("current", 1e3, "scaled_channel"),
    ("voltage", 1e3, "scaled_channel"),
    ("current", -1.0, "reversed_channel"),
    ("speed", -1.0, "reversed_channel"),
    ("voltage", -1.0, "reversed_channel"),
]
ONE_OF_EACH = pytest.mark.parametrize(("channel", "factor", "code"), FAULTS)


def with_fault(runs: list[Run], k: int, channel: str, factor: float) -> list[Run]:
    """Runs of which one has a channel multiplied by a factor."""
    faulty = replace(runs[k], **{channel: factor * getattr(runs[k], channel)})
    return [*runs[:k], faulty, *runs[k + 1 :]]


@ONE_OF_EACH
@pytest.mark.parametrize("k", range(len(PAPER)))
def test_a_wrong_scale_or_sign_in_one_run_of_four_is_refused_with_its_correction(
    k: int, channel: str, factor: float, code: str
) -> None:
    """The correction, applied to the file, multiplies the channel by the inverse."""
    (finding,) = check_runs(with_fault(PAPER, k, channel, factor)).findings

    name = f"{channel}_{UNITS[channel]}"
    assert (finding.code, finding.severity) == (code, "refuse")
    assert (finding.file, finding.column) == (PAPER[k].name, name)
    mapping = mapping_of(None, list(finding.corrections))
    read = read_run(FOLDER / PAPER[k].name, mapping=mapping)
    np.testing.assert_allclose(getattr(read, channel), getattr(PAPER[k], channel) / factor)


@ONE_OF_EACH
@pytest.mark.parametrize("count", [2, 4])
def test_half_of_the_runs_with_a_wrong_scale_or_sign_contradict_the_other_half(
    count: int, channel: str, factor: float, code: str
) -> None:
    """No majority: a sign may be wrong in either half; of two units the smaller is assumed."""
    runs = PAPER[:count]
    for k in range(count // 2):
        runs = with_fault(runs, k, channel, factor)

    refused = check_runs(runs).refused

    if code == "scaled_channel":
        (finding,) = refused
        assert finding.code == "contradicting_runs"
        (correction,) = finding.corrections
        assert correction.partition(":")[0] in {run.name for run in runs[: count // 2]}
        assert correction.partition(":")[2].startswith(f"{channel}_{UNITS[channel]}=")
    else:
        assert {f.code for f in refused} <= {"contradicting_runs", "reversed_channel"}
        assert any("opposite signs" in f.message or f.column for f in refused)


@ONE_OF_EACH
def test_the_faulty_run_is_set_aside_on_request(channel: str, factor: float, code: str) -> None:
    """The three sound runs are fitted."""
    found = admitted(with_fault(PAPER, 3, channel, factor), [], FitOptions(set_aside=True))

    assert [run.name for run in found.training] == [run.name for run in PAPER[:3]]
    assert [(run.name, role) for run, role in found.set_aside] == [(PAPER[3].name, "training")]


@ONE_OF_EACH
def test_a_run_that_determines_its_parameters_is_compared_with_those_that_do_not(
    channel: str, factor: float, code: str
) -> None:
    """A multisine determines R and K in one of the four runs, with less noise in all."""
    for noise in (0.01, 0.004):
        runs = campaign(motor_named("paper"), seed=1, runs=4, kind="multisine", noise=noise)
        sound = [e.is_sound for run in runs if (e := estimate_of(run))]
        assert sound[1]
        assert all(sound) == (noise < 0.01)

        found = check_runs(with_fault(runs, 1, channel, factor)).findings

        assert [(f.code, f.file) for f in found] == [(code, runs[1].name)]


def test_a_run_of_one_direction_is_no_run_of_magnitudes() -> None:
    """The regression gives a K below zero within its error, as current and speed are in proportion.

    Of seeds 0 to 9, two were refused as unsigned.
    """
    for seed in range(10):
        runs = campaign(motor_named("paper"), seed=seed, runs=4, kind="forward")
        assert check_runs(runs).refused == (), seed


def test_the_time_constant_tells_another_load_from_a_wrong_unit() -> None:
    """The last run has 9.55 times the friction: voltage per speed is that of a speed in rpm."""
    motor = motor_named("paper")
    braked = replace(motor, values=(*motor.values[:5], 9.55 * motor.values[5], motor.values[6]))
    rng = np.random.default_rng(1)
    runs = [
        run_of(m, drive(m, "steps", 1500, rng), np.full(1500, 25.0), np.zeros(2), name=f"{k}.csv")
        for k, m in enumerate((motor, motor, motor, braked))
    ]

    assert check_runs(runs).refused == ()


@pytest.mark.parametrize("friction", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("warming", [0.0, 30.0, 63.0])
def test_warming_hides_no_wrong_sign_and_is_none(friction: float, warming: float) -> None:
    """Signs of R and K are those of regressions whose R and K change with the temperature.

    A reversed voltage is never positive, which no magnitude is.

    With constant R and K, runs with three times the friction of the paper and 30 K were refused.
    """
    paper = motor_named("paper")
    motor = replace(paper, values=(*paper.values[:5], friction * paper.values[5], paper.values[6]))
    for seed in range(4):
        rng = np.random.default_rng(seed)
        warmth = 25.0 + warming * np.linspace(0.0, 1.0, 1500) ** 0.5
        runs = []
        for k in range(3):
            run = run_of(motor, drive(motor, "forward", 1500, rng), warmth, np.zeros(2))
            current, speed = (
                x + 0.003 * x.std() * rng.standard_normal(1500) for x in (run.current, run.speed)
            )
            runs.append(replace(run, name=f"{k}.csv", current=current, speed=speed))

        assert check_runs(runs).refused == (), seed
        for channel in UNITS:
            refused = check_runs(with_fault(runs, 1, channel, -1.0)).refused
            assert {(f.code, f.file) for f in refused} == {("reversed_channel", "1.csv")}


def drawn(seed: int) -> Motor:
    """A motor like that of the paper, with all values within a factor of two."""
    paper = motor_named("paper")
    factors = 2.0 ** np.random.default_rng(seed).uniform(-0.5, 0.5, 7)
    return replace(paper, values=tuple((paper.vector * factors).tolist()))


@pytest.mark.parametrize("seed", range(30))
def test_sound_runs_of_a_motor_with_much_friction_are_not_refused(seed: int) -> None:
    """Thirty motors, of which the last run drives a load of three times the rotor's inertia."""
    motor = drawn(seed)
    kinds: tuple[Excitation, ...] = ("steps", "forward", "binary")
    kind = kinds[seed % len(kinds)]
    loaded = motor.vector * np.array([1, 1, 1, 1, 4, 1, 1])
    other = replace(motor, values=tuple(loaded.tolist()))
    runs = campaign(motor, seed=seed, runs=3, kind=kind)
    (last,) = campaign(other, seed=seed + 100, runs=1, kind=kind)

    assert check_runs([*runs, replace(last, name="run3.csv")]).refused == ()
