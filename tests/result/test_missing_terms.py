"""Missing voltage or torque with the fitted effect, for known motors and effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.diagnosis.localise import Deficiency, Localisation, Missing
from identification.effects.electrical import BrushDrop, FluxSaturation
from identification.effects.friction import CoulombFriction, ViscousTemperature
from identification.effects.load import LoadStep, ShaftCompliance
from identification.effects.sensor import CurrentFilter
from identification.effects.thermal import SelfHeating
from identification.effects.zero import CurrentOffset
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits, solve
from identification.model.excitation import records_of
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator, initial_states
from identification.model.term import AbstractTerm
from identification.result.missing_terms import missing_terms, missing_traces, undrawn_sentence
from identification.result.partial_residuals import FinalPath, final_path
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def declared() -> Fit:
    """Servo motor without effects."""
    return fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=8)), "zoh")


def with_effect(declared: Fit, term: AbstractTerm, sizes: list[float]) -> Fit:
    """The fit with one effect of a given size added, otherwise unchanged."""
    model = declared.simulator.model.adding(term)
    known = {p.name: p for p in declared.coordinates.parameters}
    coordinates = Coordinates([known.get(p.name, p) for p in model.parameters])
    values = np.append(declared.values, sizes)
    simulator = Simulator.fitting(model, declared.simulator.records, values)
    states = [
        np.append(state, initial_states(model, record)[state.size :])
        for state, record in zip(declared.states, simulator.records, strict=True)
    ]
    place = coordinates.of(values)
    return solve(
        simulator, coordinates, place, states, declared.weighting, TerminationLimits(steps=0)
    )


def path_of(declared: Fit, term: AbstractTerm, sizes: list[float], trace: Any = None) -> FinalPath:
    """Final path of a motor with an effect of a given size; all draws are equal."""
    return certain_path(with_effect(declared, term, sizes), trace)


def certain_path(final: Fit, trace: Any = None) -> FinalPath:
    """Final path of a fit whose draws are all equal to it."""
    draws = {
        name: np.full(20, value)
        for name, value in zip(final.coordinates.names, final.values, strict=True)
    }
    return final_path(final, draws, trace)


def measured_on(fit: Fit, noise: tuple[float, float]) -> Fit:
    """The fit over records that its own motor has made, with white noise [A, rad/s]."""
    rng = np.random.default_rng(4)
    records = [
        replace(record, measured=logged + np.array(noise) * rng.standard_normal(logged.shape))
        for record, logged in zip(fit.simulator.records, fit.simulated(), strict=True)
    ]
    simulator = Simulator.fitting(fit.simulator.model, records, fit.values)
    limits = TerminationLimits(steps=0)
    return solve(simulator, fit.coordinates, fit.position, fit.states, None, limits)


def trace_of(declared: Fit, voltage: list[Array], torque: list[Array]) -> Localisation:
    """Localisation with given missing voltages and torques of each record."""
    none = Deficiency("V", 0.0, 1.0, 0.0, 1.0, False)
    pieces = []
    for k, record in enumerate(declared.simulator.records):
        zero = np.zeros(record.rows)
        pieces.append(
            Missing(record.run, record.start, record.time, voltage[k], zero, torque[k], zero)
        )
    return Localisation(none, none, np.ones(2), tuple(pieces))


def test_a_friction_torque_is_drawn_as_its_law(declared: Fit) -> None:
    """The drawn torque equals -T w / sqrt(w^2 + k^2) along the simulated speed."""
    path = path_of(declared, CoulombFriction(0.1, 1.0), [0.02, 0.0])
    speed = path.everywhere.drivers["speed"]

    drawn = path.everywhere.effects["coulomb_friction"][0]

    np.testing.assert_allclose(drawn[:, 1], -0.02 * speed / np.sqrt(speed**2 + 1.0), atol=1e-12)
    np.testing.assert_allclose(drawn[:, 0], 0.0, atol=1e-9)


SHAFT = ShaftCompliance(1.0, 10.0, 1e4)
SPRINGY = [0.6, 300.0, 0.05, 0.0]
"""Sixty percent of the inertia behind a shaft, which swings at 300 rad/s."""


def test_draws_that_diverge_leave_the_curve_and_its_band(declared: Fit) -> None:
    """A motor whose resistance is negative burns; the other draws are drawn."""
    final = with_effect(declared, CoulombFriction(0.01, 1.0), [0.004, 0.5])
    draws = {name: np.full(20, v) for name, v in final.by_name.items()}
    draws["Ra25"][::4] *= -1e3

    (term,) = missing_terms(final_path(final, draws, None))

    assert np.isfinite(term.median).all()
    assert np.isfinite(term.q05).all()


def test_friction_of_a_motor_with_an_elastic_shaft_is_drawn_as_its_law(declared: Fit) -> None:
    """The torque acts on the rotor, 40 % of the inertia, and is still the torque in N m."""
    sprung = with_effect(declared, SHAFT, SPRINGY)
    path = path_of(sprung, CoulombFriction(0.1, 1.0), [0.02, 0.0])
    found = path.everywhere
    speed = found.drivers["speed"]

    friction, shaft = (found.effects[name][0, :, 1] for name in ("coulomb_friction", SHAFT.name))

    np.testing.assert_allclose(friction, -0.02 * speed / np.sqrt(speed**2 + 1.0), atol=1e-12)
    values = path.final.by_name
    heat = 1 + values["alpha_Kt"] * (found.drivers["temperature"] - 25.0)
    driven = values["Kt25"] * heat * found.drivers["current"] - values["b"] * speed
    np.testing.assert_allclose(
        friction + shaft, values["J"] * found.rates[:, 1] - driven, atol=1e-9
    )


@pytest.mark.parametrize(
    ("other", "sizes", "term", "amount"),
    [
        (SHAFT, SPRINGY, CoulombFriction(0.1, 1.0), [0.02, 0.0]),
        (CurrentFilter(1e-5, 0.1), [3e-3], BrushDrop(24.0, 10.0), [0.8, 0.1, 2.0, 0.0, 0.0]),
    ],
    ids=["friction behind a shaft", "brushes behind a current filter"],
)
def test_dots_lie_around_the_curve_in_spite_of_a_filter_or_a_shaft(
    declared: Fit, other: AbstractTerm, sizes: list[float], term: AbstractTerm, amount: list[float]
) -> None:
    """The shaft swings with ten times the friction, and the filter hides volts of L di/dt."""
    final = with_effect(with_effect(declared, other, sizes), term, amount)

    (plot,) = missing_terms(certain_path(measured_on(final, (0.02, 0.5))))

    fitted = np.interp(plot.driver_values, plot.grid, plot.median)
    assert plot.median.max() == pytest.approx(amount[0], rel=0.05)
    assert np.std(plot.estimate - fitted) < 0.5 * amount[0]
    assert np.corrcoef(plot.estimate, fitted)[0, 1] > 0.8


def test_estimate_lies_on_the_curve_despite_a_biased_resistance(declared: Fit) -> None:
    """The nominal fit took part of the brush drop for a resistance error of 30 %."""
    term = BrushDrop(24.0, 10.0)
    sizes = {"voltage": 0.8, "knee": 0.4, "sharpness": 2.0, "openness": 1.0}
    bare = path_of(declared, term, [sizes.get(p.name, 0.0) for p in term.parameters])
    logged = bare.final.simulator.states(bare.final.values[:, None], bare.final.states)
    current = [states[:, 0, 0] for states in logged]
    drop = [-0.8 * i / np.sqrt(i**2 + 0.4**2) for i in current]
    resistance = 0.3 * bare.final.values[0]
    said = trace_of(
        declared,
        [v + resistance * i for v, i in zip(drop, current, strict=True)],
        [np.zeros(i.size) for i in current],
    )
    path = FinalPath(bare.final, bare.values, bare.states, said.missing)

    (plot,) = missing_terms(path)

    expected = -0.8 * plot.driver_values / np.sqrt(plot.driver_values**2 + 0.4**2)
    np.testing.assert_allclose(plot.estimate, expected, atol=0.02)
    assert (plot.quantity, plot.unit, plot.driver) == ("missing voltage", "V", "current")


def test_curve_of_a_brush_drop_is_as_steep_as_its_knee(declared: Fit) -> None:
    """Most samples have a small current, and the line between the bins follows the law there."""
    sizes = {"voltage": 0.8, "knee": 0.05, "sharpness": 2.0}
    term = BrushDrop(24.0, 10.0)
    path = path_of(declared, term, [sizes.get(p.name, 0.0) for p in term.parameters])

    (plot,) = missing_terms(path)

    half = np.interp([-0.4, 0.4], -plot.median, plot.grid)
    assert np.all(np.diff(plot.grid) > 0.0)
    assert np.ptp(half) < 0.2, "currents at half of the drop, 0.06 A by the law"


def test_a_change_of_friction_is_drawn_over_temperature(declared: Fit) -> None:
    """The curve is the straight line -b k (T - 25) with k = 0.004 1/K."""
    path = path_of(declared, ViscousTemperature(), [0.004, 1.0])

    (plot,) = missing_terms(path)

    friction = path.final.values[5]
    expected = -0.004 * friction * (plot.grid - 25.0)
    np.testing.assert_allclose(plot.median, expected, rtol=0.02, atol=0.01 * friction)
    assert plot.quantity == "change of b"


def test_a_loss_of_torque_constant_is_drawn_over_the_current(declared: Fit) -> None:
    """The curve is Kt (1 / (1 + c (i / i_0)^2) - 1) at every temperature."""
    path = path_of(declared, FluxSaturation(20.0), [0.3, 2.0, 0.0])

    (plot,) = missing_terms(path)

    constant = path.final.values[2]
    expected = constant * (1 / (1 + 0.3 * (plot.grid / 20.0) ** 2) - 1)
    np.testing.assert_allclose(plot.median, expected, rtol=0.15, atol=0.01 * constant)


@pytest.mark.parametrize(
    ("term", "sizes"),
    [(LoadStep(0, 0.1, 2e-3, 1.5), [0.1, 0.4, 0.9]), (SelfHeating(1.0, 0.01, 10.0), [1.0, 0.5])],
)
def test_an_effect_without_a_driver_is_drawn_over_time_only(
    declared: Fit, term: AbstractTerm, sizes: list[float]
) -> None:
    """A load step depends on the time in one run; self-heating depends on the past."""
    path = path_of(declared, term, sizes)

    assert missing_terms(path) == []
    (trace,) = missing_traces(path, ["a.csv", "b.csv", "c.csv"])
    assert trace.effect == term.name
    assert np.abs(trace.fitted).max() > 0


def test_a_sensor_effect_has_a_sentence_and_no_figure(declared: Fit) -> None:
    """A zero error of a sensor is no voltage or torque of the motor."""
    path = path_of(declared, CurrentOffset(1.0), [0.2])

    assert missing_terms(path) == []
    assert missing_traces(path, ["a", "b", "c"]) == []
    assert "on the logged signals and not in the motor" in undrawn_sentence(
        path.final.simulator.model.terms
    )
