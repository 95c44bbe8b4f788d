"""Viscous friction that is another one in each run, as in bearings that run in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.benches.excitation import voltages
from benchmarks.benches.motors import drawn_motor
from benchmarks.benches.plant import Drive, Hidden, simulated
from identification.effects.effect import AbstractEffect
from identification.effects.friction import CoulombFriction, StribeckFriction
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.selection.candidates import scales_of
from identification.selection.screen import screened
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.run_in import DryFrictionOfRuns, ViscousFrictionOfRuns
from identification.surrogates.unlisted import LAWS
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, run_of

MOTOR = motor_named("servo 100 W")
VISCOUS = MOTOR.values[5]
ROWS, NOISE = 1500, 0.003
FACTORS = (3.0, 2.0, 1.4, 1.2)


WITHHELD = all_but(
    "coulomb_friction", "stribeck_friction", "viscous_temperature", "load_torque", "inertia_change"
)


def test_viscous_friction_that_runs_in_is_that_of_each_run() -> None:
    """The search finds the friction of each run, the dry friction of none and no change of b."""
    rng = np.random.default_rng(5)
    runs = []
    for factor, degrees in zip(FACTORS, (25.0, 60.0, 25.0, 45.0), strict=True):
        motor = replace(MOTOR, values=(*MOTOR.values[:5], factor * VISCOUS, MOTOR.values[6]))
        run = run_of(motor, drive(motor, "steps", ROWS, rng), np.full(ROWS, degrees), np.zeros(2))
        noise = NOISE * rng.standard_normal((2, ROWS))
        current = run.current + noise[0] * run.current.std()
        runs.append(replace(run, current=current, speed=run.speed + noise[1] * run.speed.std()))
    campaign = campaign_of(runs[:-1], runs[-1:])

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, ViscousFrictionOfRuns)
    own = np.array([state[-1] for state in outcome.fit.states])
    found = (outcome.fit.by_name["b"] + own) / VISCOUS
    np.testing.assert_allclose(found, FACTORS[:-1], rtol=0.05)


def faded(voltage: np.ndarray, first: float, fading: float) -> np.ndarray:
    """(n, 2) current [A] and speed [rad/s] with viscous friction that falls from `first` to b.

    The equations are integrated by Heun's method in ten steps per sample.
    """
    ra, _, kt, _, inertia, viscous, inductance = MOTOR.values
    step = MOTOR.interval / 10
    state, found = np.zeros(2), np.empty((voltage.size, 2))

    def rates(at: np.ndarray, volt: float, time: float) -> np.ndarray:
        friction = viscous + (first - viscous) * np.exp(-time / fading)
        electrical = (volt - ra * at[0] - kt * at[1]) / inductance
        return np.array([electrical, (kt * at[0] - friction * at[1]) / inertia])

    for row, volt in enumerate(voltage):
        found[row] = state
        for k in range(10):
            time = step * (10 * row + k)
            slope = rates(state, volt, time)
            state = state + step * (slope + rates(state + step * slope, volt, time + step)) / 2
    return found


def test_friction_that_fades_within_each_run_has_its_time_constant() -> None:
    """Grease warms up: the friction of each run falls with half of its duration."""
    rng = np.random.default_rng(8)
    time = MOTOR.interval * np.arange(ROWS, dtype=np.float64)
    fading, runs = 0.5 * time[-1], []
    for number, factor in enumerate((3.0, 12.0, 5.0, 8.0)):
        voltage = drive(MOTOR, "steps", ROWS, rng)
        true = faded(voltage, factor * VISCOUS, fading)
        noisy = true + NOISE * true.std(axis=0) * rng.standard_normal(true.shape)
        (current, speed), warm = noisy.T, np.full(ROWS, 25.0)
        runs.append(Run(f"run{number}.csv", "0" * 64, time, voltage, current, speed, warm))
    campaign = campaign_of(runs[:-1], runs[-1:])

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, ViscousFrictionOfRuns)
    assert term.fades
    values = outcome.fit.by_name
    assert values["unlisted.fading_time"] == pytest.approx(fading, rel=0.1)
    assert values["b"] == pytest.approx(VISCOUS, rel=0.1)


def test_a_brake_of_another_setting_in_each_run_is_the_first_effect_of_a_search() -> None:
    """The friction of each run is predicted to gain more than the dry friction that all runs have.

    A search that begins with the dry friction puts it in place of both.  The simulator of the
    benches shares no code with the model.
    """
    rng = np.random.default_rng(6)
    motor = drawn_motor(rng)
    time, warm = 2e-3 * np.arange(600, dtype=np.float64), np.full(600, 25.0)
    hidden, drive_ = Hidden(dry=0.05 * motor.rated_torque), Drive(motor.rated_voltage)
    brakes = 0.2 * motor.rated_torque / motor.rated_speed * np.array([0.0, 1.0, 2.0, 0.5])
    runs = []
    for number, brake in enumerate(brakes):
        braked = replace(motor, b=motor.b + brake)
        command = voltages(motor, time, number, False, rng)
        true = simulated(braked, hidden, drive_, time, command, warm, np.zeros(time.size), 0.0)
        current = true.current + 0.004 * motor.rated_current * rng.standard_normal(time.size)
        speed = true.speed + 0.003 * motor.rated_speed * rng.standard_normal(time.size)
        runs.append(Run(f"run{number}.csv", "0" * 64, time, true.command, current, speed, warm))
    fit = fit_declared(records_of(runs), "zoh")

    laws: tuple[type[AbstractEffect], ...] = (CoulombFriction, StribeckFriction, *LAWS)
    scales = scales_of(fit)
    scores = screened(fit, [one for law in laws for one in law.candidates(scales)])
    assert isinstance(scores[0].candidate.final, ViscousFrictionOfRuns)


def test_either_friction_of_each_run_comes_back_from_a_result() -> None:
    """The settings tell dry from viscous friction."""
    entry = {"name": "unlisted", "equation": "mechanical"}

    viscous = term_of({**entry, "settings": {"viscous_size": 1e-4}})
    dry = term_of({**entry, "settings": {"dry_size": 0.01, "width": 0.1}})

    assert viscous == ViscousFrictionOfRuns(1e-4)
    assert dry == DryFrictionOfRuns(0.01, 0.1)
