"""Simulated closed loop: exact metrics for linear motors, known answers for effects."""

from __future__ import annotations

import time as clock
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate

from identification.effects.catalogue import CATALOGUE
from identification.effects.electrical import BrushDrop, InductanceSaturation
from identification.effects.friction import CoulombFriction
from identification.effects.inertia import InertiaChange
from identification.effects.load import LoadStep, LoadTorque
from identification.effects.periodic import CoggingTorque
from identification.effects.thermal import Demagnetization, SelfHeating
from identification.effects.zero import CurrentOffset, VoltageOffset
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.term import AbstractTerm
from identification.selection.candidates import scales_of
from identification.selection.refit import refitted_with
from identification.selection.start import Start
from identification.speed_loop import METRIC_UNITS, feedback_metrics
from identification.speed_loop.closed_loop import ClosedLoop, LoopRun, acting_terms, simulated_loop
from identification.speed_loop.controller import parse_controller
from identification.speed_loop.nonlinear import nonlinear_entry, simulated_loops
from identification.speed_loop.sampled import sampled_metrics
from tests.motors import NAMES, campaign, motor_named

Array = NDArray[np.float64]

PAPER = np.array([0.59, 0.004, 0.071, -0.002, 0.01, 0.1, 0.5])
RA, _, KT, _, INERTIA, FRICTION, INDUCTANCE = PAPER


def response(
    terms: tuple[AbstractTerm, ...],
    own: tuple[float, ...],
    controller: str,
    step: float,
    horizon: float,
    samples: int = 2000,
) -> LoopRun:
    """Step response of the source's motor with effects at 25 degC."""
    loop = ClosedLoop(terms, controller=parse_controller(controller))
    values = np.array([*PAPER, *own])[:, None]
    states = np.zeros(len(loop.motor.state_names) - 2)
    time = np.linspace(0.0, horizon, samples + 1)
    return simulated_loop(loop, values, states, step, [(25.0, 25.0)], time)[0]


@pytest.mark.parametrize("text", ["P:1", "P:50", "PI:1,2", "PI:20,40", "PID:3,5,0.2"])
@pytest.mark.parametrize("temperature", [25.0, 125.0])
def test_a_linear_motor_has_the_exact_metrics(text: str, temperature: float) -> None:
    """Reference: modal sums of `step_response`, which agree with the table of the source."""
    (exact,) = feedback_metrics(dict(zip(NAMES, PAPER, strict=True)), [temperature], [text])
    time = np.linspace(0.0, 6 * exact["settling_time_s"]["median"], 2001)
    loop = ClosedLoop((), controller=parse_controller(text))

    (run,) = simulated_loop(
        loop, PAPER[:, None], np.zeros(0), 10.0, [(temperature, temperature)], time
    )
    found = sampled_metrics(run.time, run.speed / 10.0, run.acceleration / 10.0)

    for name, metric in (
        ("rise_time", "rise_time_s"),
        ("settling_time", "settling_time_s"),
        ("peak", "peak"),
        ("steady_state", "steady_state"),
    ):
        assert getattr(found, name)[0] == pytest.approx(exact[metric]["median"], rel=1e-4)
    assert found.overshoot[0] == pytest.approx(exact["overshoot_percent"]["median"], abs=1e-3)


def test_dry_friction_lowers_the_final_value() -> None:
    """Steady state: kp (r - w) = Ra i + Kt w and Kt i = b w + T_c, solved for w."""
    gain, step, torque = 20.0, 30.0, 0.5
    term = CoulombFriction(1.0, 1e-3)

    run = response((term,), (torque, 0.0), f"P:{gain:g}", step, 6.0)

    stiffness = FRICTION + KT**2 / RA + KT * gain / RA
    expected = (KT * gain * step / RA - torque) / stiffness
    assert run.speed[-1, 0] == pytest.approx(expected, rel=1e-6)


def test_a_constant_load_adds_a_response_independent_of_the_step() -> None:
    """In a linear loop, the response to the load adds to that of any step."""
    term = LoadTorque(1.0)

    loss = [
        response((), (), "PI:3,4", step, 8.0).speed
        - response((term,), (0.2,), "PI:3,4", step, 8.0).speed
        for step in (5.0, 50.0)
    ]

    np.testing.assert_allclose(loss[0], loss[1], atol=1e-7)
    assert np.abs(loss[0]).max() > 0.1


def test_loop_with_friction_drop_and_cogging_is_that_of_an_independent_integration() -> None:
    """Reference: scipy's LSODA with tolerance 1e-10 on equations written out by hand."""
    gain, integral, step = 4.0, 6.0, 20.0
    drop, knee, dry, order, size = 0.8, 0.5, 0.3, 3.0, 0.4
    terms = (BrushDrop(1.0, 1.0), CoulombFriction(1.0, 0.3), CoggingTorque(1.0))

    def rates(_: float, x: Array) -> list[float]:
        current, speed, error, angle = x
        voltage = gain * (step - speed) + integral * error
        lost = drop * current / np.sqrt(current**2 + knee**2)
        torque = -dry * speed / np.sqrt(speed**2 + 0.3**2) + size * np.sin(order * angle)
        return [
            (voltage - RA * current - KT * speed - lost) / INDUCTANCE,
            (KT * current - FRICTION * speed + torque) / INERTIA,
            step - speed,
            speed,
        ]

    known = {
        "brush_drop": {"voltage": drop, "knee": knee, "sharpness": 2.0, "openness": 1.0},
        "coulomb_friction": {"torque": dry},
        "cogging_torque": {"order": order, "sine": size},
    }
    own = tuple(known[term.name].get(p.name, 0.0) for term in terms for p in term.parameters)
    run = response(terms, own, f"PI:{gain:g},{integral:g}", step, 3.0, 6000)
    solved = integrate.solve_ivp(
        rates, (0.0, 3.0), np.zeros(4), "LSODA", run.time[::100], rtol=1e-10, atol=1e-10
    )

    np.testing.assert_allclose(run.speed[::100, 0], solved.y[1], atol=2e-4)
    np.testing.assert_allclose(run.current[::100, 0], solved.y[0], atol=2e-3)


def test_a_derivative_makes_the_flux_jump() -> None:
    """Flux balance: kd r = integral of L / (1 + c (i / i_0)^2) di, which is an arc tangent."""
    reference, fall, derivative, step = 10.0, 2.0, 0.3, 5.0
    term = InductanceSaturation(reference)

    run = response((term,), (fall, 2.0, 0.0), f"PID:1,0,{derivative:g}", step, 0.1)

    root = np.sqrt(fall)
    expected = reference / root * np.tan(root * derivative * step / (INDUCTANCE * reference))
    assert run.current[0, 0] == pytest.approx(expected, rel=1e-3)


def test_only_effects_on_the_motor_at_a_fixed_temperature_are_in_the_loop() -> None:
    """Sensor errors, self-heating, and effects of one run or time span are omitted."""
    outside: tuple[AbstractTerm, ...] = (
        CurrentOffset(1.0), VoltageOffset(1.0), SelfHeating(1.0, 1.0, 10.0), InertiaChange(0),
        LoadStep(0, 1.0, 1e-3, 1.0),
    )  # fmt: skip
    inside: tuple[AbstractTerm, ...] = (
        BrushDrop(1.0, 1.0), LoadTorque(1.0), Demagnetization(20.0, 80.0)
    )  # fmt: skip

    acting = acting_terms(MotorModel((*outside, *inside)))

    assert acting == inside


@pytest.fixture(scope="module")
def fits() -> tuple[Fit, Fit]:
    """Fit of a linear servo, and the same with a negligible brush drop."""
    runs = campaign(motor_named("servo 100 W"), seed=4)
    declared = fit_declared(records_of(runs), "zoh")
    drop = BrushDrop(24.0, 10.0)
    sizes = {"voltage": 1e-9, "knee": 1.0, "sharpness": 2.0, "openness": 1.0}
    start = np.array([sizes.get(p.name, 0.0) for p in drop.parameters])
    return declared, refitted_with(declared, drop, [Start(start)])


def spread(fit: Fit, count: int = 200) -> dict[str, Array]:
    """Draws within 0.1 % of a fit."""
    rng = np.random.default_rng(1)
    return {
        name: value * (1 + 1e-3 * rng.standard_normal(count))
        for name, value in zip(fit.coordinates.names, fit.values, strict=True)
    }


def test_without_effects_nothing_is_simulated(fits: tuple[Fit, Fit]) -> None:
    """The exact metrics of the linear loop suffice."""
    assert simulated_loops(fits[0], spread(fits[0]), [25.0], ["P:1"]) == []


def test_entries_have_the_shape_of_the_exact_ones_and_their_values(fits: tuple[Fit, Fit]) -> None:
    """A negligible drop changes nothing; margins and bandwidth exist for linear loops only."""
    draws = spread(fits[1])

    exact = feedback_metrics(draws, [25.0, 125.0], ["P:1", "PI:0.2,2"])
    loops = simulated_loops(fits[1], draws, [25.0, 125.0], ["P:1", "PI:0.2,2"])
    entries = [nonlinear_entry(loop) for loop in loops]

    for entry, known in zip(entries, exact, strict=True):
        assert set(known) <= set(entry)
        assert entry["controller"] == known["controller"]
        assert entry["temperature_degC"] == known["temperature_degC"]
        assert entry["effects"] == ["brush_drop"]
        for name in ("rise_time_s", "settling_time_s", "steady_state"):
            assert entry[name]["median"] == pytest.approx(known[name]["median"], rel=2e-3)
            assert entry[name]["unit"] == METRIC_UNITS[name]
        assert entry["phase_margin_deg"]["median"] is None


def test_speed_that_ripples_around_its_final_value_has_settled(fits: tuple[Fit, Fit]) -> None:
    """Cogging of order 3 adds no torque on average, so that the final value is the linear one."""
    fit = fits[0]
    term = CoggingTorque(1.0)
    cogging = {"order": 3.0, "sine": 0.1}
    draws = spread(fit, 8)
    model = MotorModel((term,))
    draws |= {
        p.name: np.full(8, cogging.get(p.name.removeprefix("cogging_torque."), 0.0))
        for p in model.parameters[7:]
    }
    rippling = replace(fit, simulator=replace(fit.simulator, model=model))

    loops = simulated_loops(rippling, draws, [25.0, 75.0, 125.0], ["P:1"])

    linear = feedback_metrics(draws, [25.0, 75.0, 125.0], ["P:1"])
    for loop, known in zip(loops, linear, strict=True):
        last = loop.speed[-loop.time.size // 10 :]
        assert np.ptp(last, axis=0).min() > 0.03
        assert loop.settled.all()
        expected = known["steady_state"]["median"]
        assert np.median(loop.metrics.steady_state) == pytest.approx(expected, rel=2e-3)


def test_step_stays_within_the_range_of_the_runs(fits: tuple[Fit, Fit]) -> None:
    """The largest voltage of a P controller, kp r at the start, is within the range of the runs."""
    records = fits[1].simulator.records
    voltage = max(float(np.abs(r.column("voltage")).max()) for r in records)
    speed = max(float(np.abs(r.measured[:, 1]).max()) for r in records)

    (loop,) = simulated_loops(fits[1], spread(fits[1]), [25.0], ["P:2"])

    assert 0 < 2 * loop.step <= voltage
    assert loop.step <= speed


def test_motor_at_rest_has_no_step_to_simulate(fits: tuple[Fit, Fit]) -> None:
    """If the speeds of all runs are zero, no step is within their range."""
    simulator = fits[1].simulator
    still = tuple(
        replace(record, measured=np.zeros_like(record.measured)) for record in simulator.records
    )
    fit = replace(fits[1], simulator=replace(simulator, records=still))

    assert simulated_loops(fit, spread(fit), [25.0], ["P:1"]) == []


def test_default_loops_take_under_three_seconds(fits: tuple[Fit, Fit]) -> None:
    """Two temperatures, one controller, including compilation."""
    draws = spread(fits[1], 2000)
    began = clock.perf_counter()

    simulated_loops(fits[1], draws, [25.0, 125.0], ["P:1"])

    assert clock.perf_counter() - began < 3.0


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_effect_type_is_in_the_loop_or_omitted(name: str, fits: tuple[Fit, Fit]) -> None:
    """Each prototype on the fitted servo gives finite speeds, or is omitted from the loop."""
    candidates: list[Any] = CATALOGUE[name].candidates(scales_of(fits[0]))
    if not candidates:
        pytest.skip("the runs of the example cannot show it")
    term = candidates[0].term
    values = np.concatenate([fits[0].values, candidates[0].starts[:, 0]])
    acting = acting_terms(MotorModel((term,)))
    if not acting:
        assert term.equation in ("sensor", "thermal") or "time" in term.drivers
        return

    loop = ClosedLoop(acting, controller=parse_controller("P:0.1"))
    states = np.zeros(len(loop.motor.state_names) - 2)
    (run,) = simulated_loop(
        loop, values[:, None], states, 50.0, [(25.0, 25.0)], np.linspace(0, 0.2, 2001)
    )

    assert np.isfinite(run.speed).all()
