"""The hidden plant, compared with closed forms and with an independent stiff solver."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bench.declared import basis
from bench.motors import MOTORS, Motor, motor
from bench.plant import Plant, clean_plant
from bench.simulator import Simulation, Stimulus, initial_state, simulate

Array = NDArray[np.float64]


def clock(rows: int, interval: float) -> Array:
    """(rows,) sampling instants from zero."""
    return np.arange(rows, dtype=np.float64) * interval


def constant(value: float, rows: int) -> Array:
    """(rows,) constant values."""
    return np.full(rows, value)


def coasting(plant: Plant, time: Array, speed: float, temperature: float = 25.0) -> Simulation:
    """Simulate a motor without torque constant that coasts from a speed."""
    plant["Kt25"] = 0.0
    stimulus = Stimulus(time, np.zeros(time.size), constant(temperature, time.size))
    return simulate(plant, stimulus, initial_state(temperature, speed=speed), tolerance=1e-10)


def steps_of(entry: Motor, rows: int, seed: int = 4) -> Stimulus:
    """Random levels of twenty samples each, at a slowly rising temperature."""
    levels = np.random.default_rng(seed).uniform(-0.8, 0.8, rows // 20)
    time = clock(rows, entry.sample_interval)
    return Stimulus(
        time,
        np.repeat(levels, 20) * entry.rated_voltage,
        np.linspace(40, 60, rows, dtype=np.float64),
    )


@pytest.mark.parametrize("hold", ["held", "linear"])
@pytest.mark.parametrize("name", list(MOTORS))
def test_clean_motor_agrees_with_matrix_exponentials(name: str, hold: str) -> None:
    """Reference: exponential of the 2x2 system of each sample, exact between samples."""
    entry = motor(name)
    stimulus = steps_of(entry, 400)
    stimulus = Stimulus(stimulus.time, stimulus.command, constant(70.0, 400), hold == "linear")
    p = entry.parameters
    values = np.array([p[n] for n in ("Ra25", "Kt25", "J", "b", "L", "alpha_Ra", "alpha_Kt")])

    run = simulate(clean_plant(entry), stimulus, initial_state(70.0))

    exact = basis(stimulus.time, run.voltage, stimulus.temperature, values, hold == "linear")[0]
    np.testing.assert_allclose(run.state("current"), exact[0], atol=2e-7 * entry.rated_current)
    np.testing.assert_allclose(run.state("speed"), exact[1], atol=2e-7 * entry.rated_speed)


@pytest.mark.parametrize("name", ["instrument_1w", "paper_motor", "machine_tool_3kw"])
def test_clean_motor_agrees_with_radau_while_its_temperature_moves(name: str) -> None:
    """Reference: scipy's implicit Radau at 1e-10 on the two equations of the nominal model."""
    entry = motor(name)
    stimulus = steps_of(entry, 60)

    run = simulate(clean_plant(entry), stimulus, initial_state(40.0), tolerance=1e-9)

    state = np.zeros(2)
    for n in range(59):
        span = (stimulus.time[n], stimulus.time[n + 1])
        v, first, last = stimulus.command[n], *stimulus.temperature[n : n + 2]

        def rates(t: float, x: Array, v: float = v, first: float = first, last: float = last,
                  span: tuple[float, float] = span) -> list[float]:  # fmt: skip
            """Rates of current and speed between two samples."""
            rise = first + (last - first) * (t - span[0]) / (span[1] - span[0]) - 25.0
            ra = entry.Ra25 * (1 + entry.alpha_Ra * rise)
            kt = entry.Kt25 * (1 + entry.alpha_Kt * rise)
            return [(v - ra * x[0] - kt * x[1]) / entry.L, (kt * x[0] - entry.b * x[1]) / entry.J]

        scale = np.array([entry.rated_current, entry.rated_speed])
        state = solve_ivp(rates, span, state, "Radau", rtol=1e-10, atol=1e-12 * scale).y[:, -1]
        assert run.states[n + 1, :2] == pytest.approx(state, rel=1e-6, abs=1e-7 * scale.min())


def test_error_falls_with_the_tolerance() -> None:
    """A tolerance a thousand times smaller reduces the error at least a hundred times."""
    entry = motor("servo_150w")
    stimulus = steps_of(entry, 400)
    runs = [
        simulate(clean_plant(entry), stimulus, initial_state(40.0), tolerance=tolerance)
        for tolerance in (1e-5, 1e-8, 1e-12)
    ]

    coarse, fine = (np.abs(run.state("speed") - runs[2].state("speed")).max() for run in runs[:2])

    assert coarse > 100.0 * fine


def test_steady_state_is_that_of_the_two_balances() -> None:
    """Closed form: w = Kt v / (Ra b + Kt^2) and i = b w / Kt at the temperature of the run."""
    entry = motor("paper_motor")
    time = clock(3000, 0.01)
    ra, kt = 0.59 * (1 + 0.004 * 100), 0.071 * (1 - 0.002 * 100)

    run = simulate(
        clean_plant(entry),
        Stimulus(time, constant(10.0, 3000), constant(125.0, 3000)),
        initial_state(125.0),
    )

    speed = kt * 10.0 / (ra * 0.1 + kt**2)
    assert run.state("speed")[-1] == pytest.approx(speed, rel=1e-7)
    assert run.state("current")[-1] == pytest.approx(0.1 * speed / kt, rel=1e-7)


def test_supplied_energy_is_lost_or_stored() -> None:
    """The integral of v i equals copper loss, friction loss and the energy in L and J."""
    entry = motor("servo_150w")
    time = np.linspace(0.0, 0.05, 5001, dtype=np.float64)
    run = simulate(
        clean_plant(entry),
        Stimulus(time, constant(30.0, 5001), constant(25.0, 5001)),
        initial_state(25.0),
        tolerance=1e-11,
    )
    i, w = run.state("current"), run.state("speed")

    given = np.trapezoid(30.0 * i, time)
    lost = np.trapezoid(entry.Ra25 * i**2 + entry.b * w**2, time)
    stored = 0.5 * entry.L * i[-1] ** 2 + 0.5 * entry.J * w[-1] ** 2

    assert given == pytest.approx(lost + stored, rel=1e-6)


def test_coulomb_friction_stops_a_coasting_motor_at_the_time_of_the_closed_form() -> None:
    """J dw/dt = -T - b w from w0 stops at (J / b) ln(1 + b w0 / T), and stays."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    torque = 0.05 * entry.rated_torque
    plant["coulomb_forward"] = plant["coulomb_backward"] = torque
    stop = entry.J / entry.b * np.log(1.0 + entry.b * 200.0 / torque)
    time = np.array([0.0, 0.5 * stop, stop - 1e-6, stop + 1e-9, stop + 1.0])

    speed = coasting(plant, time, 200.0).state("speed")

    assert speed[2] == pytest.approx(1e-6 * torque / entry.J, rel=1e-3)
    assert speed[3:].tolist() == [0.0, 0.0]


def test_motor_stands_still_below_the_breakaway_torque_and_turns_above() -> None:
    """Set-valued friction balances torques up to its level, without creep."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    plant["coulomb_forward"] = plant["coulomb_backward"] = 0.1 * entry.rated_torque
    plant["stribeck"] = 0.05 * entry.rated_torque
    plant["stribeck_speed"], plant["stribeck_power"] = 10.0, 2.0
    volts = 0.15 * entry.rated_current * entry.Ra25
    command = np.repeat([0.999 * volts, 1.001 * volts], 500)
    time = clock(1000, 1e-3)

    run = simulate(plant, Stimulus(time, command, constant(25.0, 1000)), initial_state(25.0))

    assert not run.state("speed")[:500].any()
    assert run.state("speed")[-1] > 0.0


def test_friction_reverses_with_the_motion() -> None:
    """At constant speed, Kt i = b w + T sign(w) in both directions."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    torque = 0.1 * entry.rated_torque
    plant["coulomb_forward"], plant["coulomb_backward"] = torque, 2.0 * torque
    time = clock(4000, 1e-3)
    command = np.repeat([20.0, -20.0], 2000)

    run = simulate(plant, Stimulus(time, command, constant(25.0, 4000)), initial_state(25.0))

    i, w = run.state("current"), run.state("speed")
    assert entry.Kt25 * i[1999] == pytest.approx(entry.b * w[1999] + torque, rel=1e-6)
    assert entry.Kt25 * i[-1] == pytest.approx(entry.b * w[-1] - 2.0 * torque, rel=1e-6)


@pytest.mark.parametrize("power", [1.7, 2.0, 2.3])
def test_drag_slows_a_coasting_motor_by_its_power_law(power: float) -> None:
    """J dw/dt = -c w^n gives w^(1-n) = w0^(1-n) + (n - 1) c t / J."""
    entry = motor("ferrite_fan_30w")
    plant = clean_plant(entry)
    plant["b"], plant["drag"], plant["drag_power"] = 0.0, 0.02, power
    c = 0.02 / entry.rated_speed**power
    time = np.linspace(0.0, 1.0, 50, dtype=np.float64)

    speed = coasting(plant, time, 250.0).state("speed")

    expected = (250.0 ** (1 - power) + (power - 1) * c * time / entry.J) ** (1 / (1 - power))
    assert speed == pytest.approx(expected, rel=1e-7)


def test_two_inertias_on_a_spring_oscillate_at_their_resonance() -> None:
    """An undamped pair oscillates at sqrt(k (1/J1 + 1/J2)) about its common speed."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    plant["b"], plant["load_inertia"], plant["shaft_stiffness"] = 0.0, 0.4 * entry.J, 5.0
    plant["Kt25"] = 0.0
    resonance = np.sqrt(5.0 * (1 / (0.4 * entry.J) + 1 / (0.6 * entry.J)))
    time = np.linspace(0.0, 20 * np.pi / resonance, 201, dtype=np.float64)
    start = initial_state(25.0)
    start[1] = 10.0
    stimulus = Stimulus(time, np.zeros(201), constant(25.0, 201))

    run = simulate(plant, stimulus, start, tolerance=1e-10)

    expected = 6.0 + 4.0 * np.cos(resonance * time)
    assert run.state("speed") == pytest.approx(expected, abs=1e-5)


def test_cogging_exchanges_energy_and_loses_none() -> None:
    """Without friction, J w^2 / 2 - (A / n) cos(n theta + phi) is constant."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    plant["b"], plant["cogging_1"], plant["cogging_order_1"] = 0.0, 0.03, 7.0
    plant["cogging_phase_1"] = 0.4
    run = coasting(plant, np.linspace(0.0, 1.0, 500, dtype=np.float64), 20.0)

    energy = 0.5 * entry.J * run.state("speed") ** 2 - 0.03 / 7 * np.cos(
        7 * run.state("angle") + 0.4
    )

    assert np.ptp(energy) < 1e-7 * energy.mean()


@pytest.mark.parametrize(("order", "lag"), [(1.0, 1.0), (2.0, np.sqrt(2.0))])
def test_speed_filter_lags_a_ramp_by_its_time(order: float, lag: float) -> None:
    """A low-pass lags a ramp by tau, and a Butterworth filter by sqrt(2) tau."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    plant["b"], plant["load"] = 0.0, -0.01
    plant["speed_filter"], plant["speed_filter_order"] = 0.02, order
    run = coasting(plant, np.linspace(0.0, 1.0, 100, dtype=np.float64), 0.0)

    gap = run.state("speed")[-1] - run.state("speed_filter_1")[-1]

    assert gap == pytest.approx(0.01 / entry.J * 0.02 * lag, rel=1e-6)


def test_lagging_winding_follows_a_ramp_of_temperature_late() -> None:
    """A first-order lag deviates from a ramp by rate times time constant."""
    plant = clean_plant(motor("servo_150w"))
    plant["winding_lag"], plant["winding_lag_order"] = 0.5, 1.0
    time = np.linspace(0.0, 10.0, 1001, dtype=np.float64)

    run = simulate(plant, Stimulus(time, np.zeros(1001), 25.0 + 3.0 * time), initial_state(25.0))

    assert run.state("winding_lag_1")[-1] == pytest.approx(25.0 + 3.0 * (10.0 - 0.5), rel=1e-6)


def test_self_heating_reaches_its_steady_state() -> None:
    """The rise is heat_rise times i^2 Ra over the rated loss, with Ra at the hot winding."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    plant["heat_rise"], plant["heat_time"] = 30.0, 0.2
    plant["coulomb_forward"] = plant["coulomb_backward"] = 10.0
    time = np.linspace(0.0, 6.0, 601, dtype=np.float64)

    run = simulate(plant, Stimulus(time, constant(4.0, 601), constant(25.0, 601)),
                   initial_state(25.0))  # fmt: skip

    rise, i = run.state("heat_1")[-1], run.state("current")[-1]
    factor = 1.0 + entry.alpha_Ra * rise
    assert i == pytest.approx(4.0 / (entry.Ra25 * factor), rel=1e-6)
    assert rise == pytest.approx(30.0 * factor * (i / entry.rated_current) ** 2, rel=1e-6)


def test_overheated_magnet_stays_weak_when_it_is_cold() -> None:
    """After the heat, the back-EMF of the cold unloaded motor is lower by the lost fraction."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    plant["b"], plant["demagnetization"] = 0.0, 0.05
    plant["demagnetization_from"] = plant["demagnetization_to"] = 100.0
    time = clock(9000, 1e-3)
    warmth = np.repeat([25.0, 110.0, 25.0], 3000)

    run = simulate(plant, Stimulus(time, constant(20.0, 9000), warmth), initial_state(25.0))

    before, after = run.state("speed")[2900], run.state("speed")[-1]
    assert before == pytest.approx(20.0 / entry.Kt25, rel=1e-6)
    assert after == pytest.approx(before / 0.95, rel=1e-6)


@pytest.mark.parametrize("name", ["disc_servo_750w", "traction_10kw", "machine_tool_3kw"])
def test_drive_keeps_the_current_near_its_limit(name: str) -> None:
    """Steps that would draw many times the limit stay within a few per cent of it."""
    entry = motor(name)
    rows = 2000
    command = np.repeat([1.0, -1.0, 1.0, -1.0], rows // 4) * entry.rated_voltage
    time = clock(rows, entry.sample_interval)
    stimulus = Stimulus(time, command, constant(110.0, rows), False, 2.0 * entry.rated_current)

    run = simulate(clean_plant(entry), stimulus, initial_state(110.0))

    largest = np.abs(run.state("current")).max()
    assert 1.5 * entry.rated_current < largest < 2.1 * entry.rated_current


def test_delayed_sensor_shows_the_state_between_samples() -> None:
    """Reference: a simulation with knots at half samples, for a delay of half a sample."""
    entry = motor("servo_150w")
    stimulus = steps_of(entry, 200)
    dense = Stimulus(
        clock(400, 0.5e-3),
        np.repeat(stimulus.command, 2),
        np.interp(clock(400, 0.5e-3), stimulus.time, stimulus.temperature),
    )
    start = initial_state(40.0)

    late = simulate(clean_plant(entry), stimulus, start, looks_back={"w": ("speed", 0.5e-3)})
    fine = simulate(clean_plant(entry), dense, start)

    assert late.seen["w"][1:] == pytest.approx(fine.state("speed")[1:-1:2], rel=1e-6, abs=1e-5)


def test_bristles_bend_before_they_slide() -> None:
    """In steady sliding, the bristle torque equals its level at any speed."""
    entry = motor("servo_150w")
    plant = clean_plant(entry)
    plant["bristle_level"], plant["bristle_deflection"] = 0.05, 0.3
    time = clock(3000, 1e-3)

    run = simulate(plant, Stimulus(time, constant(20.0, 3000), constant(25.0, 3000)),
                   initial_state(25.0))  # fmt: skip

    i, w = run.state("current"), run.state("speed")
    assert run.state("bristle")[-1] == pytest.approx(0.3, rel=1e-6)
    assert entry.Kt25 * i[-1] == pytest.approx(entry.b * w[-1] + 0.05, rel=1e-6)
