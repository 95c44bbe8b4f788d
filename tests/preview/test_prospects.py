"""Expected precision of the parameters, and whether the advice to record more is true."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identification import FitOptions, identify
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.preview import check
from identification.preview.excitation import excitation_of
from identification.preview.prospects import Prospect, prospects_of
from tests.motors import NAMES, campaign, drive, motor_named, run_of

SERVO = motor_named("servo 100 W")


def prospects(runs: Sequence[Run]) -> dict[str, Prospect]:
    """Expected precision by parameter."""
    found, *_ = prospects_of(records_of(runs), excitation_of(runs))
    return {prospect.name: prospect for prospect in found}


def noisy(temperatures: Sequence[float], rows: int, noise: float, seed: int) -> list[Run]:
    """One run at each constant temperature [degC], with relative noise of both channels."""
    rng = np.random.default_rng(seed)
    runs = []
    for number, temperature in enumerate(temperatures, 1):
        clean = run_of(
            SERVO,
            drive(SERVO, "steps", rows, rng),
            np.full(rows, temperature),
            np.zeros(2),
            name=f"run{number}.csv",
        )
        current, speed = (
            channel + noise * np.std(channel) * rng.standard_normal(rows)
            for channel in (clean.current, clean.speed)
        )
        runs.append(
            Run(
                clean.name,
                f"{number:064}",
                clean.time,
                clean.voltage,
                current,
                speed,
                clean.temperature,
            )
        )
    return runs


def test_expected_precision_is_that_of_the_fit() -> None:
    """A servo without effects: the bound and the covariance of the fit agree within a fifth.

    The interval of L is wider, because a filter of the current sensor may be part of it.
    """
    runs = campaign(SERVO, seed=5)
    fitted = identify(runs, options=FitOptions(posterior=False, effects=False)).result
    for name, expected in prospects(runs).items():
        entry = fitted["parameters"][name]
        assert expected.identified == entry["identified"], name
        assert expected.sd < 1.2 * entry["sd"], name
        assert name == "L" or expected.sd > 0.8 * entry["sd"], name


def test_temperature_span_as_advised_identifies_the_coefficient() -> None:
    """Two runs 2 K apart do not determine alpha_Ra; two runs as far apart as advised do."""
    near = prospects(noisy((30.0, 32.0), 600, 0.2, 1))["alpha_Ra"]
    assert not near.identified
    advised = re.search(r"at least ([\d.]+) K apart", near.advice)
    assert advised is not None, near.advice
    span = 1.3 * float(advised[1])
    assert 4.0 < span < 250.0
    assert prospects(noisy((30.0, 30.0 + span), 600, 0.2, 2))["alpha_Ra"].identified


def test_advised_temperature_span_exceeds_that_of_a_noisy_thermometer() -> None:
    """Precise runs at one temperature: the advice is a span that a thermometer can resolve."""
    for name in ("alpha_Ra", "alpha_Kt"):
        found = prospects(noisy((30.0, 30.05), 1000, 0.0025, 7))[name]
        assert not found.identified
        advised = re.search(r"at least ([\d.]+) K apart", found.advice)
        assert advised is not None, found.advice
        assert float(advised[1]) >= 10.0


def test_hot_runs_are_advised_a_temperature_and_no_current() -> None:
    """At 80 degC alone, the values at 25 degC lack a temperature, not current or speed."""
    found = prospects(noisy((80.0, 80.0), 1000, 0.0025, 7))
    for name in ("Ra25", "Kt25"):
        assert not found[name].identified
        assert "near 25 °C" in found[name].advice


def test_runs_without_temperature_are_advised_to_log_it() -> None:
    """No temperature, no coefficient of it, and the channel is named."""
    runs = [
        Run(run.name, run.sha256, run.time, run.voltage, run.current, run.speed)
        for run in campaign(SERVO, seed=6, runs=2)
    ]
    found = prospects(runs)
    for name in ("alpha_Ra", "alpha_Kt"):
        assert not found[name].identified
        assert "temperature_degC" in found[name].advice
    assert found["Ra25"].identified


def test_record_longer_by_the_advised_factor_identifies_friction() -> None:
    """Noise hides the viscous friction; the advised number of such runs shows it."""
    few = prospects(noisy((40.0,), 500, 0.25, 3))
    lacking = [p for p in few.values() if "times as long" in p.advice]
    assert lacking, {name: p.advice for name, p in few.items()}
    one = lacking[0]
    advised = re.search(r"record ([\d.]+) times as long", one.advice)
    assert advised is not None
    count = int(np.ceil(1.5 * float(advised[1])))
    assert prospects(noisy((40.0,) * count, 500, 0.25, 4))[one.name].identified


def test_current_logged_with_another_gain_does_not_mix_two_motors() -> None:
    """A sensor that reads half the current shows half the inertia; the first run decides."""
    runs = noisy([25.0, 25.0], rows=2000, noise=1e-3, seed=4)
    half = replace(runs[1], current=0.5 * runs[1].current)

    found, _, [note] = prospects_of(records_of([runs[0], half]), excitation_of(runs))

    inertia = next(prospect for prospect in found if prospect.name == "J")
    assert inertia.value == pytest.approx(
        dict(zip(NAMES, SERVO.values, strict=True))["J"], rel=0.02
    )
    assert "reads differently in run2.csv (0.5 times)" in note


def test_filter_of_the_current_sensor_that_looks_like_an_inductance_is_suspected() -> None:
    """A low-pass of 60 ms gives L with a small deviation, at an L / Ra that no motor has."""
    runs = noisy([25.0, 25.0], rows=2000, noise=1e-3, seed=6)
    assert not check(runs).findings
    smoothed = []
    for run in runs:
        share = 1.0 - np.exp(-np.median(np.diff(run.time)) / 0.06)
        current = run.current.copy()
        for k in range(1, current.size):
            current[k] = current[k - 1] + share * (run.current[k] - current[k - 1])
        smoothed.append(replace(run, current=current))

    found = check(smoothed)

    assert {p.name: p for p in found.prospects}["L"].identified
    suspicions = {finding.code: finding for finding in found.findings}
    assert suspicions["electrical_time_constant"].severity == "suspect"
    assert found.is_accepted
