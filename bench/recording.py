"""Recording of one run: command, initial state, simulation, sensors."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bench.effects import RunPlan, Setup
from bench.excitation import EXCITATIONS, Pace, one_way
from bench.options import BenchOptions
from bench.plant import STATES, Plant
from bench.sensors import Noise, decimals_for, draw_noise, quantise, round_step
from bench.simulator import Simulation, Stimulus, initial_state, simulate

__all__ = ["BenchRun", "channel_decimals", "channel_steps", "record_run"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BenchRun:
    """One recorded run with its true signals.

    Args:
        name: Name of its file.
        role: training or validation.
        excitation: Name of the excitation.
        frame: Canonical columns, one row per sample, with the values of the file.
        hidden: The simulated run before the sensors: states, applied voltage.
        temperature: (n_sample,) true temperature at the thermometer [degC].
    """

    name: str
    role: str
    excitation: str
    frame: pd.DataFrame
    hidden: Simulation
    temperature: Array


def _command(setup: Setup, options: BenchOptions, number: int, rng: np.random.Generator) -> Array:
    """(n_sample,) voltage command of a run [V]."""
    motor = setup.motor
    interval = options.sample_interval or motor.sample_interval
    fast, slow = motor.time_constants
    shape = EXCITATIONS[options.excitation_of(number)](
        options.rows, Pace(fast / interval, slow / interval), rng
    )
    if options.is_forward_only(number):
        shape = one_way(shape)
    return options.amplitude * rng.uniform(0.75, 1.0) * motor.rated_voltage * shape


def _run_plant(setup: Setup, plan: RunPlan) -> Plant:
    """Copy of the plant with the fields that differ in this run."""
    plant: Plant = setup.plant.copy()
    for name, value in plan.overrides.items():
        plant[name] = value
    plant["load_inertia"] *= plant["J"] / setup.plant["J"]
    return plant


def _start(setup: Setup, plan: RunPlan, options: BenchOptions, rng: np.random.Generator) -> Array:
    """Initial state of a run: moving or at standstill, hidden temperatures near the logged one."""
    moving = 1.0 if options.moving_start else 0.0
    speed = moving * rng.uniform(0.05, 0.3) * setup.motor.rated_speed
    current = moving * rng.uniform(-0.2, 0.3) * setup.motor.rated_current
    angle = rng.uniform(0.0, 2.0 * math.pi)
    state = initial_state(float(plan.temperature[0]), speed, current, angle)
    off = rng.uniform(-3.0, 3.0, 2)
    state[STATES.index("winding_lag_1")] += off[0]
    state[STATES.index("winding_lag_2")] += off[0]
    state[STATES.index("magnet_lag_1")] += off[1]
    state[STATES.index("magnet_lag_2")] += off[1]
    warm = rng.uniform(0.0, 0.5)
    state[STATES.index("heat_1")] = warm * setup.plant["heat_rise"]
    state[STATES.index("heat_2")] = warm * setup.plant["heat_rise_2"]
    return state


def _instants(options: BenchOptions, lead: int, interval: float, rng: np.random.Generator) -> Array:
    """(lead + rows,) sampling instants; the run starts at zero [s]."""
    numbers = (np.arange(options.rows + lead) - lead).astype(np.float64)
    if options.jitter > 0.0:
        numbers += np.clip(options.jitter * rng.standard_normal(numbers.size), -0.45, 0.45)
        numbers -= numbers[lead]
        return np.asarray(np.round(numbers * interval, 9), np.float64)
    return np.asarray(numbers * interval, np.float64)


def _late_sensors(setup: Setup) -> dict[str, tuple[str, float]]:
    """Name of the state that each sensor shows and its delay [s], by name of the sensor."""
    late: dict[str, tuple[str, float]] = {}
    for channel in ("current", "speed"):
        is_filtered = setup.plant[f"{channel}_filter"] > 0.0
        shown = f"{channel}_filter_1" if is_filtered else channel
        late[channel] = (shown, setup.delays.get(channel, 0.0))
    if setup.difference_time > 0.0:
        late["window"] = ("angle", setup.difference_time)
    return late


def _late_voltage(simulation: Simulation, delay: float, is_linear: bool) -> Array:
    """(n_knot,) voltage as a delayed sensor shows it [V]."""
    if delay == 0.0:
        return simulation.voltage
    looked = np.maximum(simulation.time - delay, simulation.time[0])
    if is_linear:
        return np.asarray(np.interp(looked, simulation.time, simulation.voltage), np.float64)
    # The rounding of times must not shift a voltage step by one sample.
    nearest = np.searchsorted(simulation.time, looked + 1e-9 * delay, side="right") - 1
    return np.asarray(simulation.voltage[nearest], np.float64)


def channel_steps(setup: Setup, noise: Noise) -> dict[str, float]:
    """Resolution of each logged channel, 0 for none [SI]."""
    motor = setup.motor
    return {
        "voltage_V": round_step(0.5 * noise.voltage * motor.rated_voltage),
        "current_A": round_step(noise.step * noise.current * motor.rated_current),
        "speed_rad_s": round_step(noise.step * noise.speed * motor.rated_speed),
        "temperature_degC": round_step(noise.temperature_step),
        "position_rad": noise.position_step,
    }


def channel_decimals(setup: Setup, options: BenchOptions) -> dict[str, int]:
    """Number of decimals of each column in the file."""
    steps = channel_steps(setup, options.noise)
    decimals = {name: decimals_for(step) for name, step in steps.items()}
    if options.noise.position_step > 0.0:
        decimals["position_rad"] = 5
    interval = options.sample_interval or setup.motor.sample_interval
    return {"time_s": 9 if options.jitter > 0.0 else decimals_for(interval), **decimals}


def _log(
    setup: Setup, plan: RunPlan, options: BenchOptions, run: Simulation, rng: np.random.Generator
) -> pd.DataFrame:
    """Sensor readings of a simulated run."""
    motor, noise, rows = setup.motor, options.noise, options.rows
    late = run.time.size - rows
    speed = run.seen["speed"]
    if setup.difference_time > 0.0:
        speed = (run.state("angle") - run.seen["window"]) / setup.difference_time
    true = {
        "voltage": _late_voltage(run, setup.delays.get("voltage", 0.0), setup.is_linear),
        "current": run.seen["current"],
        "speed": speed,
    }
    rated = {
        "voltage": motor.rated_voltage,
        "current": motor.rated_current,
        "speed": motor.rated_speed,
    }
    units = {"voltage": "voltage_V", "current": "current_A", "speed": "speed_rad_s"}
    steps = channel_steps(setup, noise)
    columns = {"time_s": run.time[late:]}
    for channel, values in true.items():
        kind = "white" if channel == "voltage" else noise.kind
        logged = values[late:] + setup.offsets.get(channel, 0.0) * plan.offset_scale
        logged = logged + draw_noise(rows, getattr(noise, channel) * rated[channel], kind, rng)
        if options.sensor_range > 0.0 and channel != "voltage":
            reach = options.sensor_range * rated[channel]
            logged = np.clip(logged, -reach, reach)
        columns[units[channel]] = quantise(logged, steps[units[channel]])
    warmth = plan.temperature + draw_noise(rows, noise.temperature, "white", rng)
    angle = run.state("angle")[late:] + draw_noise(rows, noise.position, "white", rng)
    if options.logs_temperature:
        columns["temperature_degC"] = quantise(warmth, steps["temperature_degC"])
    if options.position != "none":
        zero = run.state("angle")[late] if options.position == "incremental" else 0.0
        columns["position_rad"] = quantise(angle - zero, steps["position_rad"])
    decimals = channel_decimals(setup, options)
    frame = pd.DataFrame({name: np.round(v, decimals[name]) for name, v in columns.items()})
    lost = range(rows // 2, rows // 2 + options.lost_rows)
    return frame.drop(index=list(lost)).reset_index(drop=True)


def record_run(
    setup: Setup, options: BenchOptions, number: int, seed: int, peak: float
) -> tuple[BenchRun, float]:
    """Simulate and record one run.

    Args:
        setup: Plant, sensors and plans of the runs.
        options: Options of the campaign.
        number: Index of the run in the order of recording.
        seed: Seed of the campaign.
        peak: Highest magnet temperature in the earlier runs [degC].

    Returns:
        The run, and the highest magnet temperature up to its end [degC].
    """
    plan = setup.runs[number]
    # The key includes the motor; otherwise, two motors with one seed would share their noise.
    key = zlib.crc32(setup.motor.name.encode())
    streams = [np.random.default_rng([seed, number, part, key]) for part in range(3)]
    interval = options.sample_interval or setup.motor.sample_interval
    latest = max([0.0, setup.difference_time, *setup.delays.values()])
    lead = math.ceil(latest / interval) + 1 if latest > 0.0 else 0
    command = _command(setup, options, number, streams[0])
    stimulus = Stimulus(
        _instants(options, lead, interval, streams[1]),
        np.concatenate([np.full(lead, command[0]), command]),
        np.concatenate([np.full(lead, plan.temperature[0]), plan.temperature]),
        setup.is_linear,
        options.current_limit * setup.motor.rated_current,
    )
    simulation = simulate(
        _run_plant(setup, plan),
        stimulus,
        _start(setup, plan, options, streams[1]),
        looks_back=_late_sensors(setup),
        peak=peak,
        tolerance=options.tolerance,
    )
    frame = _log(setup, plan, options, simulation, streams[2])
    count = sum(other.role == plan.role for other in setup.runs[: number + 1])
    run = BenchRun(
        f"{plan.role}_{count}.csv", plan.role, options.excitation_of(number), frame,
        simulation, plan.temperature,
    )  # fmt: skip
    return run, float(simulation.peak[-1])
