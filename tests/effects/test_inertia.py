"""Runs with another inertia in each, as of a bench that tries several discs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.effect import effects_of
from identification.effects.inertia import InertiaChange, InertiaOfRuns
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.result.run_values import run_values
from identification.selection.search import search
from identification.surrogates.entry import term_of
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, run_of

MOTOR = motor_named("servo 100 W")
ROWS, NOISE = 1500, 0.003
WITHHELD = all_but(
    "inertia_change", "load_torque", "coulomb_friction", "flux_saturation", "shaft_compliance"
)
TEMPERATURES = (25.0, 60.0, 25.0, 45.0)


def with_inertias(*factors: float) -> Campaign:
    """Campaign of the nominal motor with these factors on its inertia, the last run unseen."""
    rng = np.random.default_rng(11)
    runs: list[Run] = []
    for k, (factor, degrees) in enumerate(zip(factors, TEMPERATURES, strict=True)):
        ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = MOTOR.values
        values = (ra, alpha_ra, kt, alpha_kt, factor * inertia, friction, inductance)
        motor = replace(MOTOR, values=values)
        voltage = drive(motor, "steps", ROWS, rng)
        run = run_of(motor, voltage, np.full(ROWS, degrees), np.zeros(2), name=f"run{k}.csv")
        noise = NOISE * rng.standard_normal((2, ROWS))
        current = run.current + noise[0] * run.current.std()
        runs.append(replace(run, current=current, speed=run.speed + noise[1] * run.speed.std()))
    return campaign_of(runs[:-1], runs[-1:])


def test_another_inertia_in_each_run_is_an_inertia_of_each_run() -> None:
    """J is the inertia of the first run; those of the others, and of an unseen run, are theirs."""
    campaign = with_inertias(1.0, 1.5, 2.2, 1.25)

    fit = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD).fit

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, InertiaOfRuns)
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    assert np.all(np.abs(fit.position - fit.coordinates.of(MOTOR.vector)) < 4.0 * deviations)
    found = [entry["values"]["log_ratio"] for entry in run_values(term, fit, 1.0)]
    assert [one["mean"] for one in found] == pytest.approx(np.log([1.0, 1.5, 2.2]), abs=1e-3)
    assert [one["sd"] for one in found] == pytest.approx([0.0] * 3, abs=1e-3)


@pytest.mark.parametrize("factors", [(1.0, 1.5, 1.0, 1.0), (1.5, 1.5, 1.0, 1.5)])
def test_one_other_inertia_stays_one_number(factors: tuple[float, ...]) -> None:
    """A single changed run needs one parameter, the simpler law."""
    campaign = with_inertias(*factors)

    fit = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD).fit

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, InertiaChange)


def test_an_inertia_of_each_run_comes_back_from_a_result() -> None:
    """The settings distinguish the two laws."""
    each = {"name": "inertia_change", "settings": {"log_ratio_size": 0.3, "first": 0}}
    some = {"name": "inertia_change", "settings": {"run": 1, "others": [2]}}

    assert term_of(each) == InertiaOfRuns(0.3, first=0)
    assert term_of(some) == InertiaChange(1, others=(2,))
