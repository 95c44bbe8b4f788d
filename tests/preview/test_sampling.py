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
