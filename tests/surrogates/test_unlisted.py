"""Effects outside the catalogue: a curve in the right balance over the right signals."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench import EffectRequest, make_campaign
from identification.effects.catalogue import CATALOGUE
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.model.composite import INPUTS, MotorModel
from identification.model.term import Signals, Values
from identification.selection.candidates import scales_of
from identification.selection.outcome import Outcome
from identification.selection.refit import refitted_with
from identification.selection.search import search
from identification.selection.tracing import missing_curves, traced
from identification.surrogates.curves import MissingTorque
from identification.surrogates.entry import term_of
from identification.surrogates.laws import AngularFriction
from identification.surrogates.unlisted import LAWS, SURROGATES
from tests.effects.hidden import all_but, records_of_bench
from tests.motors import Motor, campaign, motor_named


def _campaign(
    motor: str | int,
    effects: list[tuple[str, float] | EffectRequest],
    seed: int,
    rows: int = 600,
) -> Campaign:
    measured = make_campaign(motor, effects, seed=seed, rows=rows, training=4, validation=1)
    return records_of_bench(measured)


FRICTIONS = ("coulomb_friction", "stribeck_friction", "quadratic_drag", "viscous_temperature")


def _outcome(campaign: Campaign, *rivals: str) -> Outcome:
    """Outcome of a search among these kinds of the catalogue, or among all."""
    withheld = all_but(*rivals) if rivals else ()
    return search(fit_declared(campaign.training, "zoh"), campaign, withheld=withheld)


@pytest.mark.parametrize(
    ("effect", "equation", "driver", "rivals"),
    [
        ("commutation_loss", "electrical", "current", ()),
        ("time_ripple", "mechanical", "time", ("cogging_torque", "load_step", "load_torque")),
        ("bristle_friction", "mechanical", "speed", FRICTIONS),
        ("load_dependent_friction", "mechanical", "current", (*FRICTIONS, "flux_saturation")),
        ("angle_rub", "mechanical", "position", ("cogging_torque", *FRICTIONS)),
    ],
)
def test_an_effect_in_no_catalogue_is_called_unlisted(
    effect: str, equation: str, driver: str, rivals: tuple[str, ...]
) -> None:
    """The bench declares equation and driver of the effect."""
    outcome = _outcome(_campaign("servo_150w", [(effect, 0.1)], seed=21), *rivals)

    assert "unlisted" in [found.name for found in outcome.effects]
    term = next(t for t in outcome.fit.simulator.model.terms if t.name == "unlisted")
    assert term.equation == equation
    assert driver in term.drivers
    criteria = next(found.criteria for found in outcome.effects if found.name == "unlisted")
    assert criteria.validation is not None
    assert criteria.validation > 0.5 * criteria.possible


def test_a_drag_that_bends_more_than_drags_do_is_called_unlisted() -> None:
    """Square-law rubbing above a speed: its best exponent exceeds that of a fan."""
    rub = EffectRequest("rub_above_speed", 0.065, law="square")
    campaign = _campaign("servo_150w", [rub], seed=25)

    outcome = _outcome(campaign, *FRICTIONS)

    assert [found.name for found in outcome.effects] == ["unlisted"]
    assert outcome.fit.simulator.model.terms[0].drivers == ("speed",)


def test_a_curve_that_may_be_meant_as_well_is_an_alternative() -> None:
    """The same rubbing at half the amplitude is hardly distinguishable from a steep drag."""
    rub = EffectRequest("rub_above_speed", 0.026, law="square")
    campaign = _campaign("servo_150w", [rub], seed=25, rows=1200)

    (found,) = _outcome(campaign, *FRICTIONS).effects

    assert found.name == "quadratic_drag"
    assert [other.name for other in found.alternatives] == ["unlisted"]
    assert 0.005 < found.alternatives[0].probability < 0.5


def test_a_drag_of_another_power_is_still_a_drag() -> None:
    """An exponent of fans and windage, without a curve."""
    drag = EffectRequest("quadratic_drag", 0.1, law="power_2.3")
    campaign = _campaign("servo_150w", [drag], seed=26)

    (found,) = _outcome(campaign, *FRICTIONS).effects

    assert found.name == "quadratic_drag"
    assert not found.alternatives


def test_a_friction_above_a_speed_is_traced_to_speed_in_the_mechanical_balance() -> None:
    """Of the single signals, the driver of the simulated torque ranks first."""
    campaign = _campaign("servo_150w", [("rub_above_speed", 0.1)], seed=22)

    traces = traced(missing_curves(fit_declared(campaign.training, "zoh")))

    assert (traces[0].equation, traces[0].driver) == ("mechanical", "speed")
    assert all(trace.share < 1.0 for trace in traces[1:])


def test_a_curve_leaves_to_the_declared_parameters_what_they_can_do() -> None:
    """By construction each basis function is orthogonal to current and speed over the runs."""
    campaign = _campaign("servo_150w", [], seed=23)
    scales = scales_of(fit_declared(campaign.training, "zoh"))
    term = next(c.term for c in MissingTorque.candidates(scales) if c.term.drivers == ("speed",))
    assert isinstance(term, MissingTorque)

    columns = np.concatenate([term.columns(r, *r.measured.T) for r in scales.records])
    signals = np.concatenate([r.measured for r in scales.records])

    size = np.linalg.norm(columns, axis=0)[:, None] * np.linalg.norm(signals, axis=0)
    assert np.abs(columns.T @ signals / size).max() < 0.05


def test_a_search_that_begins_with_a_curve_adds_no_second_one() -> None:
    """No single curve describes both hidden torques; the name of a term occurs once."""
    hidden = [EffectRequest("time_ripple", 0.1), EffectRequest("rub_above_speed", 0.1)]
    campaign = _campaign("servo_150w", list(hidden), seed=25)
    declared = fit_declared(campaign.training, "zoh")
    score = missing_curves(declared)[0]
    begin = refitted_with(declared, score.candidate.final, list(score.starts))
    assert missing_curves(begin)[0].gain > 100.0

    outcome = search(declared, campaign, begin=begin, withheld=CATALOGUE)

    assert [term.name for term in outcome.fit.simulator.model.terms] == ["unlisted"]


def test_an_unlisted_term_comes_back_from_a_result_as_it_was() -> None:
    """Its settings pass through JSON; the rates of the motor are the same."""
    campaign = _campaign("servo_150w", [], seed=24)
    scales = replace(scales_of(fit_declared(campaign.training, "zoh")), frequencies=(20.0,))

    terms = [c.final for kind in (*SURROGATES, *LAWS) for c in kind.candidates(scales)]
    assert {type(term) for term in terms} == {*SURROGATES, *LAWS}

    for term in terms:
        entry = {"name": "unlisted", "equation": term.equation, "settings": term.settings}
        again = term_of(json.loads(json.dumps(entry)))

        assert again == term
        model = MotorModel((again,))
        x, u = ca.SX.sym("x", len(model.state_names)), ca.SX.sym("u", len(INPUTS))
        p = ca.SX.sym("p", len(model.parameters))
        rates = ca.Function("rates", [x, u, p], [model.rates(x, u, p)])
        assert np.isfinite(np.asarray(rates(1.0, np.ones(len(INPUTS)), 0.5))).all()


def test_a_friction_round_the_turn_pushes_as_its_torque_says() -> None:
    """The torque scored along a trajectory equals that of the model with the term."""
    campaign = _campaign("servo_150w", [], seed=24)
    (candidate,) = AngularFriction.candidates(scales_of(fit_declared(campaign.training, "zoh")))
    term = candidate.term
    assert isinstance(term, AngularFriction)
    record = campaign.training[0]
    current, speed = record.measured.T

    forces = term.forces(record, current, speed, candidate.starts)

    names = ("current", "speed", "voltage", "temperature", "angle", "time", "run")
    signals = Signals(**{n: ca.SX.sym(n) for n in names}, peak_temperature=ca.SX(0))
    amplitudes = ca.SX.sym("p", len(term.parameters))
    values = Values(**{q.name: amplitudes[k] for k, q in enumerate(term.parameters)})
    inputs = [signals.speed, signals.angle, amplitudes]
    torque = ca.Function("torque", inputs, [term.torque(signals, Values(), values)])
    for k, start in enumerate(candidate.starts.T):
        expected = np.asarray(torque(speed[None, :], record.column("angle")[None, :], start))
        np.testing.assert_allclose(forces[:, k], expected[0], atol=1e-12)


def run_in(motor: Motor, run: Run, rng: np.random.Generator) -> Run:
    """Run with dry friction that decays during the run, integrated by SciPy."""
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = motor.values
    assert run.temperature is not None
    resistance = ra * (1 + alpha_ra * (run.temperature - 25.0))
    constant = kt * (1 + alpha_kt * (run.temperature - 25.0))

    def rates(t: float, x: Any) -> list[float]:
        n = min(int(t / motor.interval + 1e-9), run.rows - 1)
        dry = 0.02 * (1 + 3 * np.exp(-t / 0.3)) * x[1] / np.hypot(x[1], 0.3)
        return [
            (run.voltage[n] - resistance[n] * x[0] - constant[n] * x[1]) / inductance,
            (constant[n] * x[0] - friction * x[1] - dry) / inertia,
        ]

    span, step = (0.0, float(run.time[-1])), motor.interval / 2
    solved = solve_ivp(rates, span, [0.0, 0.0], "RK23", run.time, max_step=step)
    noise = np.array([[0.02], [0.3]]) * rng.standard_normal(solved.y.shape)
    current, speed = solved.y + noise
    return replace(run, current=current, speed=speed)


def test_a_friction_that_runs_in_anew_is_traced_to_the_time_in_the_run() -> None:
    """Dry friction decays within each run, also in the validation run."""
    motor, rng = motor_named("servo 100 W"), np.random.default_rng(3)
    clean = campaign(motor, seed=12, noise=0.0, runs=4, rows=1200)
    runs = [run_in(motor, run, rng) for run in clean]
    found = campaign_of(runs[:3], runs[3:])

    outcome = _outcome(found, *FRICTIONS, "load_torque", "load_step")

    (term,) = [t for t in outcome.fit.simulator.model.terms if t.name == "unlisted"]
    assert isinstance(term, MissingTorque)
    assert term.variant.startswith("curve over time in the run, times sign of speed")
    assert term.drivers == ("time", "speed")
