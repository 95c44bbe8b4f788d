"""Sampling interval against the time constants: the rate comes before any advice on excitation."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from identification.ingest.run import Run
from identification.preview import Preview, check
from identification.preview.prospects import sampling_note
from tests.motors import NAMES, Motor, campaign, motor_named

SERVO = motor_named("servo 100 W")
SERVO_VALUES = dict(zip(NAMES, SERVO.values, strict=True))


def decimated(factor: int, motor: Motor = SERVO) -> list[Run]:
    """Runs of a motor with noise of 2 %, of which each `factor`-th sample was logged."""
    steps = replace(motor, dwell=round(0.7 * motor.dwell * factor))
    runs = campaign(steps, seed=3, runs=2, rows=1500 * factor, noise=0.02)
    logged = []
    for run in runs:
        assert run.temperature is not None
        signals = (run.time, run.voltage, run.current, run.speed, run.temperature)
        time, voltage, current, speed, temperature = (
            np.ascontiguousarray(signal[::factor]) for signal in signals
        )
        logged.append(Run(run.name, run.sha256, time, voltage, current, speed, temperature))
    return logged


def advice(found: Preview) -> dict[str, str]:
    """Advice on each parameter that is not identified, temperature coefficients left out."""
    named = {p.name: p.advice for p in found.prospects if p.advice}
    return {name: text for name, text in named.items() if not name.startswith("alpha")}


def test_sampling_slower_than_both_transients_is_said_before_the_excitation() -> None:
    """100 ms a sample at time constants of 3 and 12 ms: the rate leads each advice and the notes.

    The advised rate exceeds twenty samples in the slower of the two time constants.
    """
    found = check(decimated(100))
    texts = advice(found)
    assert texts
    for text in (*texts.values(), found.notes[0].rpartition("; ")[2]):
        wanted = re.match(r"sample at ([\d.]+) Hz or faster \(now 10 Hz\)", text)
        assert wanted is not None, text
        assert float(wanted[1]) > 10.0 / 0.012
    assert "neither the electrical nor the mechanical transient" in found.notes[0]


def test_sampling_slower_than_both_transients_identifies_neither_inertia_nor_inductance() -> None:
    """At 100 ms a sample, the estimate of J is wrong by a factor of over ten.

    The torque constant follows from constant speeds: its estimate is that of the motor.
    """
    found = {p.name: p for p in check(decimated(100)).prospects}

    assert not abs(np.log(found["J"].value / SERVO_VALUES["J"])) < np.log(10.0)
    for name in ("J", "L"):
        assert not found[name].identified
        assert found[name].sd == np.inf
        assert found[name].advice.startswith("sample at ")
    assert found["Kt25"].value == pytest.approx(SERVO_VALUES["Kt25"], rel=0.05)


def test_only_the_electrical_transient_is_too_fast_for_a_millisecond() -> None:
    """L/Ra of 0.1 ms, J Ra/Kt^2 of 5 ms: the note concerns L, at five samples in 0.1 ms."""
    coreless = motor_named("coreless 10 W")
    note = sampling_note(dict(zip(NAMES, coreless.values, strict=True)), 1e-3)
    wanted = re.search(r"electrical time constant of 0.1\d* ms.*sample at (\d+) Hz", note)
    assert wanted is not None, note
    assert 5 / 1.1e-4 < float(wanted[1]) < 5 / 0.9e-4


def test_resolved_transients_have_no_remark() -> None:
    """The rate of the servo's bench, and one three times slower, below the natural period."""
    for factor in (1, 3):
        assert sampling_note(SERVO_VALUES, factor * SERVO.interval) == ""


def test_an_inductance_that_the_runs_do_not_show_yields_the_rate_of_a_typical_winding() -> None:
    """L/Ra of 0.02 ms at 3 ms a sample: the estimate is arbitrary, and no rate follows from it.

    A rate of five samples in the arbitrary estimate would be hundreds of kilohertz.
    """
    ra, alpha_ra, kt, alpha_kt, inertia, friction, _ = SERVO.values
    values = (ra, alpha_ra, kt, alpha_kt, inertia, friction, 2e-5 * ra)
    found = check(decimated(3, replace(SERVO, values=values)))
    inductance = next(p for p in found.prospects if p.name == "L")
    assert not inductance.identified
    assert "typically" in found.notes[0]
    for text in (inductance.advice, found.notes[0].rpartition("; ")[2]):
        wanted = re.match(r"sample at ([\d.]+) Hz or faster", text)
        assert wanted is not None, text
        assert 4e3 < float(wanted[1]) < 8e3


def chopped(rows: int, seed: int) -> Run:
    """Run of a chopped servo, of which the log has the supply voltage and whole degrees.

    Structure of public logs of position-controlled servos: the controller switches the motor, the
    log has the constant supply, and the speed is the difference of a coarse angle.
    """
    run = campaign(replace(SERVO, dwell=20), seed=seed, runs=1, rows=600, noise=0.02)[0]
    interval, degree = np.diff(run.time), np.pi / 180.0
    angle = np.concatenate(([0.0], np.cumsum(run.speed[1:] * interval)))
    speed = np.diff(np.round(angle / degree) * degree) / interval
    kept = slice(1, rows)
    supply = np.full(rows - 1, 24.0)
    return Run(run.name, run.sha256, run.time[kept], supply, run.current[kept], speed[: rows - 1])


@pytest.mark.parametrize(("rows", "seed"), [(200, 3), (200, 5), (600, 4)])
def test_time_constants_that_the_runs_do_not_determine_yield_no_rate(rows: int, seed: int) -> None:
    """From arbitrary estimates, rates of 230 kHz and 480 MHz were advised.

    Nothing beyond five samples in the 1 ms of a typical winding follows from these runs, and 1 ms
    a sample is not too long for the time constants of 3 and 12 ms.
    """
    found = check(chopped(rows, seed))

    texts = [*advice(found).values(), *found.notes]
    rates = [float(rate) for text in texts for rate in re.findall(r"sample at ([\d.e+]+) Hz", text)]
    assert max(rates, default=0.0) <= 5e3
    assert not any("is too long for this motor" in text for text in texts)


def test_model_that_explains_little_is_noted_before_anything_else() -> None:
    """At a constant voltage the model predicts a constant current and speed, and both change."""
    found = check(chopped(600, 3))

    assert re.match(
        r"the nominal model explains little of the current \(NRMSE \d+\.\d %\) and the speed "
        r"\(NRMSE .*check that voltage_V is the voltage at the motor terminals",
        found.notes[0],
    )
    assert not any("explains little" in note for note in check(decimated(1)).notes)
