"""Laws of friction cover those of real motors."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bench import BenchRun, make_campaign
from benchmarks.coverage import run_of
from identification.effects.friction import CoulombFriction, QuadraticDrag, ViscousTemperature
from identification.effects.parameters import one_sign
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.model.term import AbstractTorque, Signals, Values
from identification.selection.candidates import scales_of
from identification.selection.refit import refitted_with
from identification.selection.start import Start

Array = NDArray[np.float64]

HEAT = np.linspace(-10.0, 100.0, 120)


def factor(rate: float, form: float) -> Array:
    """Friction at each temperature relative to 25 degC."""
    t = ca.SX.sym("t")
    none = [ca.SX(0)] * 4
    signals = Signals(none[0], none[1], none[2], t, *none)
    found = ViscousTemperature().factor(signals, Values(), Values(rate=rate, form=form))
    answer: Array = np.asarray(ca.Function("b", [t], [found])(HEAT[None, :]))[0]
    return answer


@pytest.mark.parametrize(
    ("law", "tolerance"),
    [
        (np.exp(-0.02 * (HEAT - 25.0)), 1e-6),
        (1.0 - 0.008 * (HEAT - 25.0), 1e-4),
        (1.0 / (1.0 + 0.02 * (HEAT - 25.0)), 1e-6),
        (np.exp(800.0 / (HEAT + 95.0) - 800.0 / 120.0), 0.1),
    ],
    ids=["exponential", "straight", "hyperbola", "Vogel"],
)
def test_grease_of_every_usual_law_is_met(law: Array, tolerance: float) -> None:
    """From -10 to 100 degC, relative error; Vogel's law falls by a factor of 200."""

    def error(x: Array) -> Array:
        return np.asarray(np.log(x[2] * factor(x[0], x[1])) - np.log(law))

    starts = [(0.01, 0.5, 1.0), (0.02, -0.5, 1.0), (0.007, 0.9, 1.0)]
    bounds = ([-0.05, -2.0, 0.5], [0.1, 1.0, 2.0])
    costs = [np.abs(least_squares(error, x, bounds=bounds).fun).max() for x in starts]

    assert min(costs) < tolerance


def test_the_form_of_grease_has_no_gap_where_it_is_exponential() -> None:
    """Through zero the factor changes by as little as the shape parameter."""
    forms = np.linspace(-1e-2, 1e-2, 41)

    factors = np.array([factor(0.02, form) for form in forms])

    steps = np.abs(np.diff(np.log(factors), axis=0))
    assert steps.max() < 2.0 * np.median(steps.max(axis=1))


def test_a_fan_may_differ_between_its_directions() -> None:
    """The asymmetry is half the difference over the mean."""
    w = ca.SX.sym("w")
    none = [ca.SX(0)] * 6
    signals = Signals(none[0], w, *none)
    values = Values(torque=0.2, exponent=2.0, asymmetry=0.3)
    torque = ca.Function("t", [w], [QuadraticDrag(1.0, 100.0).torque(signals, Values(), values)])

    there, back = float(torque(100.0)), float(torque(-100.0))

    assert there == pytest.approx(-0.2 * 1.3, rel=1e-4)
    assert back == pytest.approx(0.2 * 0.7, rel=1e-4)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(
    "term", [CoulombFriction(1.0, 1e-3), QuadraticDrag(1.0, 100.0)], ids=lambda term: term.name
)
def test_one_direction_determines_the_torque_in_it_and_no_asymmetry(
    term: CoulombFriction | QuadraticDrag, direction: int
) -> None:
    """The torque there is the parameter; the other one has the ratio (1 - a) / (1 + a) to it."""
    term = dataclasses.replace(term, direction=direction)
    speeds = direction * np.linspace(10.0, 200.0, 20)

    torques = {a: torques_of(term, speeds, asymmetry=a) for a in (-0.4, 0.0, 0.4)}

    for a, found in torques.items():
        np.testing.assert_allclose(found, torques[0.0], rtol=1e-5)
        ratio = (1 - a * direction) / (1 + a * direction)
        np.testing.assert_allclose(torques_of(term, -speeds, a), -ratio * found, rtol=1e-5)


def torques_of(term: AbstractTorque, speeds: Array, asymmetry: float) -> Array:
    """Torque of 0.2 N m at each speed, with an exponent of 2 where the law has one [N m]."""
    w = ca.SX.sym("w")
    values = Values(torque=0.2, exponent=2.0, asymmetry=asymmetry)
    signals = Signals(ca.SX(0), w, *[ca.SX(0)] * 6)
    torque = ca.Function("t", [w], [term.torque(signals, Values(), values)])
    answer: Array = np.asarray(torque(speeds[None, :]))[0]
    return answer


@pytest.mark.parametrize(
    ("low", "high", "sign"),
    [(0.0, 5.0, 1), (-5.0, 0.0, -1), (-0.4, 5.0, 1), (-0.6, 5.0, 0), (-5.0, 5.0, 0)],
)
def test_a_signal_has_one_sign_if_the_other_is_a_tenth_of_it(
    low: float, high: float, sign: int
) -> None:
    """Over all records together."""
    assert one_sign([np.array([low, 0.0]), np.array([0.0, high])]) == sign


def longest_forward(run: BenchRun) -> BenchRun:
    """Longest part of a run in which the motor turns forward."""
    forward = run.frame["speed_rad_s"].to_numpy() > 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[0], forward, [0]])))
    start, stop = max(edges.reshape(-1, 2), key=lambda span: span[1] - span[0])
    return dataclasses.replace(run, frame=run.frame.iloc[start:stop])


def test_runs_in_one_direction_determine_their_friction() -> None:
    """The deviation of the torque falls from the prior's 20 % of it to that of the noise."""
    runs = make_campaign("servo_150w", [("coulomb_friction", 0.05)], seed=3, rows=1000, training=2)
    forward = [run_of(longest_forward(run), f"{k}.csv") for k, run in enumerate(runs.training)]
    fit = fit_declared(campaign_of(forward, []).training, "zoh")
    scales = scales_of(fit)
    (candidate,) = CoulombFriction.candidates(scales)

    for direction, least, most in ((1, 0.0, 0.02), (0, 0.1, 0.3)):
        term = CoulombFriction(scales.torque, 1e-3 * scales.speed, direction=direction)
        found = refitted_with(fit, term, [Start(candidate.starts[:, 0])])
        at = found.coordinates.names.index("coulomb_friction.torque")
        assert least < found.deviations[at] / found.values[at] < most
    assert scales.direction(1) == 1
