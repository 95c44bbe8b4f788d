"""Several thermal effects together."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from identification.effects.effect import effects_of
from identification.effects.lag import WindingLag
from identification.effects.thermal import ResistanceCurvature, SelfHeating
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.solve import TerminationLimits
from identification.ingest.run import Run
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator, initial_states
from identification.model.term import AbstractTerm
from identification.selection.evidence import EvaluatedModel
from identification.selection.refit import refitted_as
from identification.selection.steps import State, enrich
from identification.selection.trials import Trials
from identification.work import Budget
from tests.motors import Motor, campaign, drive, motor_named, run_of, simulated

Array = NDArray[np.float64]


def test_a_winding_that_lags_is_heated_by_its_losses_all_the_same() -> None:
    """The order of the two effects does not matter; the lag alone is another motor."""
    motor = motor_named("servo 100 W")
    records = records_of(campaign(motor, seed=2, runs=1))
    heats, lags = SelfHeating(1.0, 0.01, 10.0), WindingLag(0.01, 10.0)
    values = {"self_heating": [2.0, 0.3], "winding_lag": [0.2]}

    def current(*terms: AbstractTerm) -> Array:
        model = MotorModel(terms)
        own = np.array([*motor.vector, *[v for term in terms for v in values[term.name]]])
        simulator = Simulator.fitting(model, records, own)
        return simulator.logged(own[:, None], [initial_states(model, records[0])])[0][:, 0, 0]

    both = current(heats, lags)

    np.testing.assert_allclose(both, current(lags, heats), rtol=1e-6, atol=1e-6)
    assert np.abs(both - current(lags)).max() > 0.01 * np.abs(both).max()


def test_a_winding_is_heated_by_the_loss_in_the_resistance_that_it_has() -> None:
    """At steady heat, the rise is the thermal resistance times the loss in the curved Ra."""
    heats, curves = SelfHeating(1.0, 0.01, 10.0), ResistanceCurvature()
    model, motor = MotorModel((heats, curves)), motor_named("servo 100 W")
    values = np.array([*motor.values, 2.0, 0.5, -8e-6])
    logged, current, rise = 80.0, 1.5, 200.0
    inputs = np.zeros(len(INPUTS))
    inputs[INPUTS.index("temperature")] = logged
    symbols = model.symbols()
    rates = ca.Function("rates", list(symbols), [model.rates(*symbols)])
    state = [current, 0.0, rise]
    found = float(np.asarray(rates(state, inputs, values))[2, 0])
    warm = logged + rise - 25.0
    resistance = values[0] * (1.0 + values[1] * warm + values[-1] * warm**2)
    assert found == pytest.approx((2.0 * resistance * current**2 - rise) / 0.5, rel=1e-12)


def warming(motor: Motor, share: float, surroundings: float, seed: int, rows: int = 1500) -> Run:
    """Run whose losses heat the winding, and the magnet by a share of it, with 1 % of noise.

    The logged temperature is that of the surroundings [degC].
    """
    rng = np.random.default_rng(seed)
    voltage, logged = drive(motor, "steps", rows, rng), np.full(rows, surroundings)
    resistance, per_kelvin = motor.values[:2]
    rise = np.zeros(rows)
    for _ in range(6):
        winding, magnet = logged + rise, logged + share * rise
        read = simulated(motor.vector, motor.interval, voltage, winding, np.zeros(2), magnet=magnet)
        loss = resistance * (1.0 + per_kelvin * (winding - 25.0)) * read[:, 0] ** 2
        for k in range(rows - 1):
            rise[k + 1] = rise[k] + (0.9 * loss[k] - rise[k]) / (0.3 * rows)
    read = read + 0.01 * read.std(axis=0) * rng.standard_normal(read.shape)
    run = run_of(motor, voltage, logged, np.zeros(2), name=f"run{seed}.csv")
    return dataclasses.replace(run, current=read[:, 0], speed=read[:, 1])


def with_effect(name: str, runs: Sequence[Run]) -> tuple[Trials, EvaluatedModel, EvaluatedModel]:
    """The nominal model of the runs and that with an effect."""
    split = campaign_of(runs, ())
    trials = Trials(split)
    declared = trials.evaluate(fit_declared(split.training, "zoh"))
    score = next(s for s in trials.scores(declared) if s.candidate.term.name == name)
    (model,) = trials.finish_best(declared, trials.refits(declared, [score]))
    return trials, declared, model


def heated(share: float) -> tuple[Trials, EvaluatedModel, EvaluatedModel]:
    """Three runs of a motor with such a magnet, its nominal model and that with self-heating."""
    motor = motor_named("ferrite 50 W")
    runs = [warming(motor, share, 25.0 + 30.0 * k, seed=k) for k in range(3)]
    return with_effect("self_heating", runs)


@pytest.mark.parametrize("share", [0.0, 0.8])
def test_a_magnet_that_the_winding_heats_is_told_from_a_cool_one(share: float) -> None:
    """With a cool magnet in the model, Kt25 would be that of a warmer one, several percent off."""
    trials, declared, model = heated(share)
    state = State(trials, declared, model)

    enrich(state)

    found = state.current.fit.by_name
    assert found["Kt25"] == pytest.approx(motor_named("ferrite 50 W").values[2], rel=0.01)
    assert ("self_heating.magnet_share" in found) is (share > 0.0)
    assert found.get("self_heating.magnet_share", 0.0) == pytest.approx(share, abs=0.1)


def test_the_fit_of_a_warm_magnet_starts_from_a_cool_one() -> None:
    """On a long record, a fit that starts far above the cost of the cool one is abandoned."""
    _, _, model = heated(0.8)
    (term,) = effects_of(model.fit.simulator.model.terms)
    warm = next(form for form in term.richer if form.variant == "warm magnet")

    start = refitted_as(model.fit, warm, TerminationLimits(0))

    assert start.cost == pytest.approx(model.fit.cost, abs=1.0)


def test_an_expensive_variant_leaves_no_other_out() -> None:
    """The first variant spends more than the budget, and the others are tried all the same."""
    state = State(*heated(0.0))
    state.trials.budget = Budget(1e6)

    enrich(state)

    variants = {searched.detail for searched in state.searched}
    assert {"warm magnet", "two thermal bodies"} <= variants
    assert not state.trials.budget.spent


def at_temperature(degrees: float, third: float, rng: np.random.Generator) -> Run:
    """Run at a constant temperature with a resistance of second and third order."""
    motor, rows = motor_named("servo 100 W"), 800
    rise = degrees - 25.0
    ra, alpha_ra, kt, alpha_kt, *mechanical = motor.values
    warm = ra * (1.0 + alpha_ra * rise + 4e-6 * rise**2 + third * rise**3)
    own = np.array([warm, 0.0, kt * (1.0 + alpha_kt * rise), 0.0, *mechanical])
    voltage = drive(motor, "steps", rows, rng)
    read = simulated(own, motor.interval, voltage, np.full(rows, 25.0), np.zeros(2))
    read = read + 0.003 * read.std(axis=0) * rng.standard_normal(read.shape)
    run = run_of(motor, voltage, np.full(rows, degrees), np.zeros(2), name=f"{degrees:.0f}.csv")
    return dataclasses.replace(run, current=read[:, 0], speed=read[:, 1])


@pytest.mark.parametrize("third", [0.0, -4e-8])
def test_a_third_order_of_the_resistance_is_found_where_there_is_one(third: float) -> None:
    """Without it, the coefficients of first and second order would be wrong."""
    rng = np.random.default_rng(5)
    runs = [at_temperature(degrees, third, rng) for degrees in (5, 30, 55, 80, 105, 130)]
    state = State(*with_effect("resistance_curvature", runs))

    enrich(state)

    found = state.current.fit.by_name
    assert found["alpha_Ra"] == pytest.approx(motor_named("servo 100 W").values[1], rel=0.02)
    assert ("resistance_curvature.third_order" in found) is (third != 0.0)
    assert found.get("resistance_curvature.third_order", 0.0) == pytest.approx(third, abs=5e-9)
