"""A motor that turns against a return spring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from identification.effects.effect import effects_of
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.spring import ReturnSpring
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, run_of

MOTOR = motor_named("servo 100 W")
ROWS, NOISE = 1500, 0.003
STIFFNESS, PRELOAD = 0.05, 0.1


WITHHELD = all_but("load_torque", "cogging_torque", "shaft_compliance", "coulomb_friction")


def against_a_spring(rng: np.random.Generator, degrees: float) -> Run:
    """Run of the nominal motor with a preloaded linear spring, exact for each interval."""
    voltage = drive(MOTOR, "steps", ROWS, rng)
    run = run_of(MOTOR, voltage, np.full(ROWS, degrees), np.zeros(2))
    ra, kt, inertia, friction, inductance = MOTOR.warm(degrees)
    rates = np.zeros((5, 5))
    rates[0] = -ra / inductance, -kt / inductance, 0.0, 1.0 / inductance, 0.0
    rates[1] = np.array([kt, -friction, -STIFFNESS, 0.0, -PRELOAD]) / inertia
    rates[2, 1] = 1.0
    step = expm(MOTOR.interval * rates)
    state, states = np.zeros(3), []
    for held in voltage:
        states.append(state)
        state = (step @ [*state, held, 1.0])[:3]
    current, speed, _ = np.array(states).T
    noise = NOISE * rng.standard_normal((2, ROWS))
    current, speed = current + noise[0] * current.std(), speed + noise[1] * speed.std()
    return replace(run, current=current, speed=speed)


def test_a_return_spring_is_found_with_its_stiffness() -> None:
    """The parameters are those of the motor, and the preload is an initial angle."""
    rng = np.random.default_rng(3)
    runs = [against_a_spring(rng, degrees) for degrees in (25.0, 60.0, 25.0, 45.0)]
    campaign = campaign_of(runs[:-1], runs[-1:])

    fit = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD).fit

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, ReturnSpring)
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    position = fit.coordinates.of(np.append(MOTOR.vector, STIFFNESS))
    assert np.all(np.abs(fit.position - position) < 4.0 * deviations)
    assert [s[2] for s in fit.states] == pytest.approx([PRELOAD / STIFFNESS] * 3, rel=0.05)


def test_a_return_spring_comes_back_from_a_result() -> None:
    """Its settings are those of no other surrogate."""
    settings = {"torque_size": 1.0, "angle_size": 20.0}
    entry = {"name": "unlisted", "equation": "mechanical", "settings": settings}

    assert term_of(entry) == ReturnSpring(1.0, 20.0)
