"""Viscous friction that is another one in each run, as in bearings that run in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.run_in import DryFrictionOfRuns, ViscousFrictionOfRuns
from tests.motors import drive, motor_named, run_of

MOTOR = motor_named("servo 100 W")
VISCOUS = MOTOR.values[5]
ROWS, NOISE = 1500, 0.003
FACTORS = (3.0, 2.0, 1.4, 1.2)


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

    outcome = search(fit_declared(campaign.training, "zoh"), campaign)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, ViscousFrictionOfRuns)
    own = np.array([state[-1] for state in outcome.fit.states])
    found = (outcome.fit.by_name["b"] + own) / VISCOUS
    np.testing.assert_allclose(found, FACTORS[:-1], rtol=0.05)


def test_either_friction_of_each_run_comes_back_from_a_result() -> None:
    """The settings tell dry from viscous friction."""
    entry = {"name": "unlisted", "equation": "mechanical"}

    viscous = term_of({**entry, "settings": {"viscous_size": 1e-4}})
    dry = term_of({**entry, "settings": {"dry_size": 0.01, "width": 0.1}})

    assert viscous == ViscousFrictionOfRuns(1e-4)
    assert dry == DryFrictionOfRuns(0.01, 0.1)
