"""Runs in which the motor has another resistance or torque constant than in the others."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from identification.effects.effect import effects_of
from identification.fit.solve import Fit
from identification.ingest import Run
from identification.result.run_values import run_values
from identification.selection.omitted import consider_variances
from identification.selection.reference_run import reference_runs
from identification.surrogates.coefficient import (
    ResistanceChange,
    ResistanceOfRuns,
    TorqueConstantChange,
    TorqueConstantOfRuns,
)
from identification.surrogates.entry import term_of
from identification.surrogates.gain import InEachRun, InSomeRuns
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, run_of
from tests.surrogates.searched import outcome_of

MOTOR = motor_named("servo 100 W")
ROWS, NOISE = 1500, 0.003
TEMPERATURES = (25.0, 60.0, 60.0, 25.0, 45.0, 35.0)
FACTORS = (1.0, 1.05, 0.97, 1.02, 0.98, 1.0)
DECLARED = ["Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L"]
WITHHELD = all_but(
    "inertia_change", "self_heating", "winding_lag", "flux_saturation", "load_torque"
)
OF: dict[str, tuple[type[InSomeRuns], type[InEachRun]]] = {
    "Ra25": (ResistanceChange, ResistanceOfRuns),
    "Kt25": (TorqueConstantChange, TorqueConstantOfRuns),
}


def measured(
    name: str, factors: tuple[float, ...], temperatures: tuple[float, ...] = TEMPERATURES
) -> list[Run]:
    """Six runs, the last one for validation, in which a parameter is multiplied by a factor."""
    rng = np.random.default_rng(11)
    runs = []
    for degrees, factor in zip(temperatures, factors, strict=True):
        a, b, c, d, e, f, g = MOTOR.vector * np.where(np.array(DECLARED) == name, factor, 1.0)
        motor = replace(MOTOR, values=(a, b, c, d, e, f, g))
        voltage = drive(MOTOR, "steps", ROWS, rng)
        run = run_of(motor, voltage, np.full(ROWS, degrees), np.zeros(2))
        noise = NOISE * rng.standard_normal((2, ROWS))
        current = run.current + noise[0] * run.current.std()
        runs.append(replace(run, current=current, speed=run.speed + noise[1] * run.speed.std()))
    return runs


@functools.cache
def fit_of(name: str, factors: tuple[float, ...]) -> Fit:
    """Fit of the model that the search selects."""
    return outcome_of(measured(name, factors), WITHHELD).fit


@pytest.mark.parametrize(("name", "change"), [("Ra25", 0.08), ("Kt25", -0.03)])
def test_another_value_in_one_run_is_named(name: str, change: float) -> None:
    """A longer cable or a weaker magnet in the second run is no change of inertia and no heat."""
    fit = fit_of(name, (1.0, 1.0 + change, 1.0, 1.0, 1.0, 1.0))

    (term,) = effects_of(fit.simulator.model.terms)
    assert term == OF[name][0](1)
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    position = fit.coordinates.of(np.append(MOTOR.vector, change))
    assert np.all(np.abs(fit.position - position) < 4.0 * deviations)


@pytest.mark.parametrize("name", OF)
def test_another_value_in_each_run_is_a_value_of_each_run(name: str) -> None:
    """The parameters are those of the first run.

    With a constant temperature in each run, the differences are known as well as the coefficient.
    """
    fit = fit_of(name, FACTORS)

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, OF[name][1])
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    assert np.all(np.abs(fit.position - fit.coordinates.of(MOTOR.vector)) < 4.0 * deviations)
    found = [entry["values"]["change"]["mean"] for entry in run_values(term, fit, 1.0)]
    assert found == pytest.approx(np.array(FACTORS[:-1]) - 1.0, abs=1e-2)


@pytest.mark.parametrize("factors", [(1.05, 1.0, 1.05, 1.0, 1.0, 1.0), FACTORS])
def test_the_interval_contains_the_value_of_the_other_runs(factors: tuple[float, ...]) -> None:
    """Any run may have the usual value, so the interval has to contain that of each of them."""
    fit = fit_of("Kt25", factors)

    variances = np.diag(fit.equations.covariance()) + consider_variances(fit, reference_runs(fit))
    for factor in factors[:-1]:
        values = MOTOR.vector * np.where(np.array(DECLARED) == "Kt25", factor, 1.0)
        others = fit.coordinates.of(np.append(values, fit.values[7:]))
        assert np.all(np.abs(fit.position - others) < 3.0 * np.sqrt(variances))


def test_runs_at_one_temperature_widen_a_coefficient_to_its_prior_at_most() -> None:
    """The resistance at that temperature is known but for the difference between the runs."""
    runs = measured("Ra25", FACTORS, (40.0, 40.1, 40.0, 40.1, 40.0, 40.1))
    fit = outcome_of(runs, WITHHELD).fit

    added = np.sqrt(consider_variances(fit, reference_runs(fit)))

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, ResistanceOfRuns)
    prior = fit.coordinates.prior_sd[1]
    warm = 15.0 * prior * fit.coordinates.slopes(fit.position)[1]
    assert added[1] <= prior
    assert added[0] == pytest.approx(np.hypot(term.gain_size, warm), rel=0.05)


def test_a_change_comes_back_from_a_result() -> None:
    """The settings name the coefficient, as those of a voltage with another gain do not."""
    some, each = {"run": 1, "others": [2]}, {"gain_size": 0.03, "first": 0}
    resistance = {"name": "unlisted", "equation": "electrical"}
    constant = {"name": "unlisted", "equation": "mechanical"}

    found = [
        term_of({**resistance, "settings": {**some, "coefficient": "Ra"}}),
        term_of({**resistance, "settings": {**each, "coefficient": "Ra"}}),
        term_of({**constant, "settings": {**some, "coefficient": "Kt"}}),
        term_of({**constant, "settings": {**each, "coefficient": "Kt"}}),
    ]

    assert found == [
        ResistanceChange(1, others=(2,)),
        ResistanceOfRuns(0.03, first=0),
        TorqueConstantChange(1, others=(2,)),
        TorqueConstantOfRuns(0.03, first=0),
    ]
