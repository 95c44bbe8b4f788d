"""Recording of a campaign: the motor, its hidden effects and the tables of the bench."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.benches.cases import Cell
from benchmarks.benches.excitation import speeds, voltages
from benchmarks.benches.motors import BenchMotor, drawn_motor
from benchmarks.benches.plant import Drive, Hidden, Trajectory, simulated

__all__ = ["Recorded", "recorded"]

Array = NDArray[np.float64]
Random = np.random.Generator

_CURRENT_NOISE: Final = 0.004
_SPEED_NOISE: Final = 0.003
_VOLTAGE_NOISE: Final = 1e-4
_CURRENT_STEP: Final = 0.002
_SPEED_STEP: Final = 0.0005
"""Standard deviations and resolutions of the sensors, relative to rated values."""
_COUNTS: Final = (2000, 4096, 8192)


@dataclass(frozen=True)
class Recorded:
    """A recorded campaign.

    Args:
        motor: The motor.
        hidden: Types of the effects hidden in motor and sensors.
        tables: One per run, the validation run last.
        truth: True values of the parameters that are counted.
        noise: (2,) noise in the validation run, root mean square [A, rad/s].
    """

    motor: BenchMotor
    hidden: tuple[str, ...]
    tables: tuple[pd.DataFrame, ...]
    truth: dict[str, float]
    noise: Array


@dataclass(frozen=True)
class _Bench:
    """Constants of all runs of a campaign."""

    cell: Cell
    motor: BenchMotor
    hidden: Hidden
    drive: Drive
    zeros: Array
    lag: float
    counts: int


def recorded(cell: Cell, seed: int, rows: int) -> Recorded:
    """Record a campaign of three training runs and one validation run.

    Args:
        cell: Case and kind of motor.
        seed: Equal seeds give equal campaigns.
        rows: Samples per run.
    """
    rng = np.random.default_rng([seed, 1210])
    motor = drawn_motor(rng)
    kinds = _kinds(cell, rng)
    bench = _Bench(
        cell=cell,
        motor=motor,
        hidden=_hidden(motor, kinds, rng),
        drive=_drive(cell.case.name, motor, rng),
        zeros=_zeros(cell.case.name, motor, kinds, rng),
        lag=rng.uniform(3.0, 15.0) if cell.case.name == "thermocouple" else 0.0,
        counts=int(rng.choice(_COUNTS)),
    )
    runs = [_run(bench, number, rows, rng) for number in range(len(cell.case.temperatures))]
    truth = {name: float(getattr(motor, name)) for name in ("Ra25", "Kt25", "J", "b")}
    if cell.case.name == "no_thermometer":
        warmer = runs[0][2] - 25.0
        truth["Ra25"] *= 1.0 + motor.alpha_Ra * warmer
        truth["Kt25"] *= 1.0 + motor.alpha_Kt * warmer
    hidden = tuple(kind for kind in kinds if kind not in cell.case.needed)
    return Recorded(motor, hidden, tuple(run[0] for run in runs), truth, runs[-1][1])


def _kinds(cell: Cell, rng: Random) -> tuple[str, ...]:
    if cell.motor != "mixed":
        own = ("coulomb_friction", "brush_drop") if cell.motor == "friction" else ()
        return own + cell.case.needed
    pool = ["brush_drop", "self_heating", "current_offset", "current_filter", "stribeck_friction"]
    has_angle = cell.case.name == "everything_angle"
    pool += [] if has_angle else ["cogging_torque"]
    first = ["coulomb_friction", *(["cogging_torque"] if has_angle else [])]
    count = int(rng.integers(3, 6)) - len(first)
    return (*first, *(str(kind) for kind in rng.choice(pool, count, replace=False)))


def _hidden(motor: BenchMotor, kinds: Sequence[str], rng: Random) -> Hidden:
    """Effects of realistic size; all sizes are drawn, so that a seed determines the motor."""
    torque, copper = motor.rated_torque, motor.Ra25 * motor.rated_current**2
    sizes = {
        "coulomb_friction": {"dry": rng.uniform(0.03, 0.08) * torque},
        "stribeck_friction": {
            "stribeck": rng.uniform(0.02, 0.06) * torque,
            "stribeck_speed": rng.uniform(0.02, 0.05) * motor.rated_speed,
        },
        "brush_drop": {
            "brush": rng.uniform(0.02, 0.05) * motor.rated_voltage,
            "brush_knee": rng.uniform(0.03, 0.1) * motor.rated_current,
        },
        "cogging_torque": {
            "cogging": rng.uniform(0.03, 0.08) * torque,
            "cogging_order": float(rng.choice([10, 12, 14, 16, 20, 22, 24, 28])),
        },
        "self_heating": {
            "heating": rng.uniform(20.0, 40.0) / copper,
            "heating_time": rng.uniform(4.0, 20.0),
        },
        "current_filter": {"filter_time": 5e-4 * 10.0 ** rng.uniform()},
    }
    chosen: dict[str, float] = {}
    for kind in kinds:
        chosen |= sizes.get(kind, {})
    return Hidden(**chosen)


def _drive(name: str, motor: BenchMotor, rng: Random) -> Drive:
    if name == "speed_loop":
        delay = 1e-3 + motor.L / motor.Ra25
        gain = motor.Kt25 * min(3.0, 0.3 * motor.mechanical_time_constant / delay)
        integral = 0.5 * gain / motor.mechanical_time_constant
        return Drive(1.2 * motor.rated_voltage, proportional=gain, integral=integral)
    if name == "commanded":
        return Drive(
            motor.rated_voltage,
            source=rng.uniform(0.05, 0.3) * motor.Ra25,
            dead_time=rng.uniform(0.01, 0.03) * motor.rated_voltage,
            dead_zone=rng.uniform(0.005, 0.02) * motor.rated_voltage,
            current_scale=0.03 * motor.rated_current,
        )
    return Drive(motor.rated_voltage)


def _zeros(name: str, motor: BenchMotor, kinds: Sequence[str], rng: Random) -> Array:
    """(n_run,) zero error of the current sensor in each run [A]."""
    if name == "current_zero":
        walk = np.cumsum([rng.uniform(0.005, 0.015), *rng.normal(0.0, 0.005, 3)])
        return motor.rated_current * walk
    error = rng.uniform(0.005, 0.015) * motor.rated_current
    return np.full(4, error if "current_offset" in kinds else 0.0)


def _run(bench: _Bench, number: int, rows: int, rng: Random) -> tuple[pd.DataFrame, Array, float]:
    """Table of a run, its noise, and its mean temperature [degC]."""
    case, motor = bench.cell.case, bench.motor
    time: Array = case.intervals[number] * np.arange(rows, dtype=np.float64)
    if case.name == "jitter":
        scatter = np.clip(rng.normal(0.0, 0.1, rows), -0.35, 0.35)
        time = time + case.intervals[number] * (scatter - scatter[0])
    drift = case.drift * rng.uniform(-1.0, 1.0)
    temperature = case.temperatures[number] + drift * -np.expm1(-2.0 * time / time[-1])
    wanted = (
        speeds(motor, time, rng)
        if bench.drive.proportional
        else voltages(motor, time, number, case.name == "one_way", rng)
    )
    seen = _SPEED_NOISE * motor.rated_speed * rng.standard_normal(rows)
    angle = rng.uniform(0.0, 2.0 * math.pi)
    true = simulated(motor, bench.hidden, bench.drive, time, wanted, temperature, seen, angle)
    table, ideal = _logged(bench, number, time, true, seen, rng)
    if case.name != "no_thermometer":
        table["temperature_degC"] = _thermometer(time, temperature, bench.lag, rng)
    noise = np.array([np.std(table[name] - values) for name, values in ideal.items()])
    if case.name == "missing_rows":
        table = _with_missing(table, rng)
    return table, noise, float(np.mean(temperature))


def _logged(
    bench: _Bench, number: int, time: Array, true: Trajectory, seen: Array, rng: Random
) -> tuple[pd.DataFrame, dict[str, Array]]:
    """Electrical and mechanical columns, with and without noise."""
    case, motor, rows = bench.cell.case, bench.motor, time.size
    current = true.filtered + bench.zeros[number]
    speed, measured = true.speed, _rounded(true.speed + seen, _SPEED_STEP * motor.rated_speed)
    if case.name == "encoder":
        line = 2.0 * math.pi / bench.counts
        interval = np.diff(time, prepend=time[0] - case.intervals[number])
        speed = np.diff(true.angle, prepend=true.angle[0]) / interval
        counted = line * np.floor(true.angle / line)
        measured = np.diff(counted, prepend=counted[0]) / interval
    noisy = current + _CURRENT_NOISE * motor.rated_current * rng.standard_normal(rows)
    voltage = true.command
    if case.name != "commanded":
        voltage = voltage + _VOLTAGE_NOISE * motor.rated_voltage * rng.standard_normal(rows)
    table = pd.DataFrame(
        {
            "time_s": time,
            "voltage_V": voltage,
            "current_A": _rounded(noisy, _CURRENT_STEP * motor.rated_current),
            "speed_rad_s": measured,
        }
    )
    if case.name == "everything_angle":
        table["position_rad"] = _rounded(true.angle, 2.0 * math.pi / bench.counts)
    return table, {"current_A": current, "speed_rad_s": speed}


def _thermometer(time: Array, temperature: Array, lag: float, rng: Random) -> Array:
    """A thermometer with 0.1 K of noise, or a thermocouple with a lag [s] and 1 K steps."""
    if lag == 0.0:
        return _rounded(temperature + 0.1 * rng.standard_normal(time.size), 0.1)
    shown = np.empty(time.size)
    value = temperature[0]
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        value += (temperature[k] - value) * -math.expm1(-step / lag)
        shown[k] = value
    return _rounded(shown, 1.0)


def _with_missing(table: pd.DataFrame, rng: Random) -> pd.DataFrame:
    """Remove 0.5 % of the rows and a block of 2 %."""
    kept = rng.random(len(table)) > 0.005
    start = int(rng.integers(len(table) // 3, len(table) // 2))
    kept[start : start + len(table) // 50] = False
    return table[kept]


def _rounded(values: Array, step: float) -> Array:
    return np.round(values / step) * step
