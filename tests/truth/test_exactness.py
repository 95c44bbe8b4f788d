"""Accuracy of the simulation against independent solvers and conservation laws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator
from identification.model.step_plan import StepPlan
from identification.model.substeps import evenly
from tests.motors import Motor, driven, motor_named, simulated
from tests.terms import MagneticDrag

Array = NDArray[np.float64]
Hold = Literal["zoh", "foh"]

SERVO = motor_named("servo 100 W")
# An electrical time constant ten times shorter than the sample interval.
STIFF = Motor(
    "stiff", (*SERVO.values[:6], SERVO.values[0] * SERVO.interval / 10), 24.0, SERVO.interval, 3
)
# 0.5 H behind 0.59 ohm: an electrical time constant of 0.85 s, sampled every 10 ms.
PAPER = motor_named("paper")


def by_radau(
    values: Array,
    interval: float,
    voltage: Array,
    temperature: Array,
    start: Array,
    hold: Hold,
    extra_torque: Callable[[float], float] = lambda speed: 0.0,
) -> Array:
    """Current and speed by scipy's implicit Radau solver, one interval at a time, (n_sample, 2)."""
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = values

    def rates(t: float, x: Array, k: int) -> list[float]:
        share = t / interval
        slope = voltage[k + 1] - voltage[k] if hold == "foh" else 0.0
        heat = temperature[k] + share * (temperature[k + 1] - temperature[k]) - 25.0
        constant = kt * (1 + alpha_kt * heat)
        lost = ra * (1 + alpha_ra * heat) * x[0] + constant * x[1]
        driving = constant * x[0] - friction * x[1] + extra_torque(x[1])
        return [(voltage[k] + share * slope - lost) / inductance, driving / inertia]

    out = [np.asarray(start, dtype=float)]
    for k in range(voltage.size - 1):
        solution = solve_ivp(
            rates, (0.0, interval), out[-1], method="Radau", rtol=1e-10, atol=1e-12, args=(k,)
        )
        out.append(solution.y[:, -1])
    return np.array(out)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("motor", [STIFF, PAPER, SERVO], ids=lambda motor: motor.name)
def test_the_simulation_agrees_with_radau(motor: Motor, hold: Hold) -> None:
    """Reference: scipy's Radau at 1e-10; the motor warms by 2 K/s, fast for its thermal mass."""
    run = driven(motor, 14, seed=1, warming=2.0)
    assert run.temperature is not None
    start = np.array([0.1 * motor.voltage / motor.values[0], 0.2 * motor.voltage / motor.values[2]])
    records = records_of([run])
    model = MotorModel(hold=hold)

    simulator = Simulator.fitting(model, records, motor.vector)
    logged = simulator.logged(motor.vector[:, None], [start])[0][:, :, 0]

    temperature = records[0].column("temperature")
    expected = by_radau(motor.vector, motor.interval, run.voltage, temperature, start, hold)
    size = np.abs(expected).max(axis=0)
    # A thermometer resolution of 0.1 degC changes the current by 4e-4, far more than this.
    np.testing.assert_allclose(logged / size, expected / size, atol=5e-6)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("motor", [STIFF, PAPER, SERVO], ids=lambda motor: motor.name)
def test_at_constant_temperature_the_simulation_is_as_exact_as_radau(
    motor: Motor, hold: Hold
) -> None:
    """Reference: scipy's Radau at 1e-10; the tolerance of the matrix series is 1e-8."""
    run = driven(motor, 14, seed=2, warming=0.0)
    assert run.temperature is not None
    start = np.array([0.1 * motor.voltage / motor.values[0], 0.2 * motor.voltage / motor.values[2]])
    simulator = Simulator.fitting(MotorModel(hold=hold), records_of([run]), motor.vector)

    logged = simulator.logged(motor.vector[:, None], [start])[0][:, :, 0]

    expected = by_radau(motor.vector, motor.interval, run.voltage, run.temperature, start, hold)
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(logged / size, expected / size, atol=2e-8)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("motor", [STIFF, PAPER, SERVO], ids=lambda motor: motor.name)
def test_the_runs_of_the_tests_are_those_of_radau(motor: Motor, hold: Hold) -> None:
    """The closed form that generates the test data agrees with scipy's Radau at 1e-10."""
    run = driven(motor, 10, seed=3, warming=0.0)
    assert run.temperature is not None
    arguments = (motor.vector, motor.interval, run.voltage, run.temperature, np.zeros(2))

    made = simulated(*arguments, hold)

    expected = by_radau(*arguments, hold)
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(made / size, expected / size, atol=2e-8)


def slope_of_errors(counts: list[int], errors: list[float]) -> float:
    """Order of convergence: slope of log error over log number of substeps."""
    return float(-np.polyfit(np.log(counts), np.log(errors), 1)[0])


def test_the_step_is_of_third_order_where_the_model_is_not_linear() -> None:
    """Theory: the exponential Rosenbrock pair 32 has order 3; the reference solution is Radau's."""
    run = driven(SERVO, 15, seed=4, warming=0.0)
    assert run.temperature is not None
    size = 2e-6
    values = np.append(SERVO.vector, size)
    start = np.array([1.0, 50.0])
    records = records_of([run])
    model = MotorModel((MagneticDrag(),), hold="foh")

    def torque(speed: float) -> float:
        return -size * speed * float(np.sqrt(speed**2 + 1e-6))

    exact = by_radau(
        SERVO.vector, SERVO.interval, run.voltage, run.temperature, start, "foh", torque
    )
    counts, errors = [1, 2, 4, 8], []
    for parts in counts:
        simulator = Simulator(model, tuple(records), StepPlan(terms=14), evenly([15], parts))
        logged = simulator.logged(values[:, None], [start])[0][:, :, 0]
        errors.append(float(np.abs(logged - exact)[:, 1].max()))

    assert 2.8 < slope_of_errors(counts, errors) < 3.3
    assert errors[0] < 1e-4 * np.abs(exact[:, 1]).max()


def test_the_warming_of_the_motor_enters_with_second_order() -> None:
    """Each interval uses its midpoint temperature; the reference solution is Radau's."""
    run = driven(PAPER, 15, seed=5, warming=100.0)
    records = records_of([run])
    temperature = records[0].column("temperature")
    start = np.array([5.0, 20.0])
    exact = by_radau(PAPER.vector, PAPER.interval, run.voltage, temperature, start, "zoh")
    counts, errors = [1, 2, 4], []

    for parts in counts:
        simulator = Simulator(MotorModel(), tuple(records), StepPlan(terms=14), evenly([15], parts))
        logged = simulator.logged(PAPER.vector[:, None], [start])[0][:, :, 0]
        errors.append(float(np.abs(logged - exact)[:, 0].max()))

    assert 1.8 < slope_of_errors(counts, errors) < 2.2


@pytest.mark.parametrize("motor", [SERVO, PAPER], ids=lambda motor: motor.name)
def test_electrical_work_is_heat_and_friction_and_stored_energy(motor: Motor) -> None:
    """Conservation of energy: the back-EMF power equals the mechanical power."""
    sample = np.arange(2001)
    waves = 0.5 * np.sin(2 * np.pi * sample / 700) + 0.5 * np.cos(2 * np.pi * sample / 300)
    run = replace(driven(motor, 2001, seed=6, warming=0.0), voltage=motor.voltage * waves)
    start = np.array([2.0, 30.0])
    simulator = Simulator.fitting(MotorModel(hold="foh"), records_of([run]), motor.vector)
    ra, alpha_ra, _, _, inertia, friction, inductance = motor.values
    resistance = ra * (1 + alpha_ra * 35.0)

    logged = simulator.logged(motor.vector[:, None], [start])[0][:, :, 0]

    current, speed = logged.T
    stored = 0.5 * inductance * current**2 + 0.5 * inertia * speed**2
    supplied = by_simpson(run.voltage * current, motor.interval)
    lost = by_simpson(resistance * current**2 + friction * speed**2, motor.interval)
    assert supplied == pytest.approx(lost + stored[-1] - stored[0], rel=1e-4)


def by_simpson(series: Array, interval: float) -> float:
    """Integral of a series with an odd number of samples by Simpson's rule."""
    inner = 4.0 * series[1:-1:2].sum() + 2.0 * series[2:-2:2].sum()
    return float(interval / 3.0 * (series[0] + inner + series[-1]))
