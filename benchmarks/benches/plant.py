"""Motor, drive and speed controller in the time domain: classical Runge-Kutta at a fixed fine step.

Dry friction is set-valued (Karnopp, J. Dynamic Systems 107 (1985), 100-103): its sign is constant
within a step, a shaft that stops sticks, and it breaks away if the torque exceeds the static
friction.  The code is plain Python on floats, compiled by numba; it shares nothing
with `bench/` or with the library.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.benches.motors import BenchMotor

__all__ = ["Drive", "Hidden", "Trajectory", "simulated"]

Array = NDArray[np.float64]

_FINENESS: Final = 0.4
"""Largest product of step and fastest rate of the motor."""
_FEWEST: Final = 8
"""Smallest number of steps per sample interval."""


@dataclass(frozen=True)
class Hidden:
    """Effects that the nominal model lacks; zero for none.

    Args:
        dry: Coulomb friction [N m].
        stribeck: Additional friction at standstill [N m].
        stribeck_speed: Speed at which `stribeck` has decreased to 1/e [rad/s].
        brush: Voltage drop at the brushes [V].
        brush_knee: Knee current of the voltage drop [A].
        cogging: Amplitude [N m].
        cogging_order: Periods per revolution.
        heating: Thermal resistance of the winding [K/W].
        heating_time: Thermal time constant of the winding [s].
        filter_time: Time constant of the current sensor [s].
    """

    dry: float = 0.0
    stribeck: float = 0.0
    stribeck_speed: float = 1.0
    brush: float = 0.0
    brush_knee: float = 1.0
    cogging: float = 0.0
    cogging_order: float = 1.0
    heating: float = 0.0
    heating_time: float = 1.0
    filter_time: float = 0.0


@dataclass(frozen=True)
class Drive:
    """Output stage and speed controller; zero for an ideal voltage source without controller.

    Args:
        limit: Maximum output voltage [V].
        proportional: Gain of the speed controller [V s/rad]; 0 for an open loop.
        integral: Its integral gain [V/rad].
        source: Resistance of the supply [ohm].
        dead_time: Voltage lost to dead times, with the sign of the current [V].
        dead_zone: Command below which the output is zero [V].
        current_scale: Current scale of the smoothed sign function [A].
    """

    limit: float
    proportional: float = 0.0
    integral: float = 0.0
    source: float = 0.0
    dead_time: float = 0.0
    dead_zone: float = 0.0
    current_scale: float = 1.0


@dataclass(frozen=True)
class Trajectory:
    """The true signals at the samples, (n_sample,) each.

    Args:
        command: Voltage command from this sample to the next [V].
        current: [A].
        filtered: Current after the filter of the sensor [A].
        speed: [rad/s].
        angle: [rad].
    """

    command: Array
    current: Array
    filtered: Array
    speed: Array
    angle: Array


class _Plant(NamedTuple):
    """All parameters of motor, hidden effects and drive, with the same names."""

    Ra25: float
    alpha_Ra: float
    Kt25: float
    alpha_Kt: float
    J: float
    b: float
    L: float
    dry: float
    stribeck: float
    stribeck_speed: float
    brush: float
    brush_knee: float
    cogging: float
    cogging_order: float
    heating: float
    heating_time: float
    filter_time: float
    limit: float
    proportional: float
    integral: float
    source: float
    dead_time: float
    dead_zone: float
    current_scale: float


def simulated(
    motor: BenchMotor,
    hidden: Hidden,
    drive: Drive,
    time: Array,
    wanted: Array,
    temperature: Array,
    noise: Array,
    angle: float,
) -> Trajectory:
    """Simulate one run from standstill.

    Args:
        motor: The motor.
        hidden: Effects in addition to the nominal model.
        drive: Drive and controller.
        time: (n_sample,) sampling times, at which the voltage changes as well [s].
        wanted: (n_sample,) voltage [V], or speed [rad/s] where the drive has a controller.
        temperature: (n_sample,) of magnet and housing [degC].
        noise: (n_sample,) of the speed that the controller sees [rad/s].
        angle: At the start [rad].

    Raises:
        FloatingPointError: The simulation is not finite.
    """
    rate = motor.Ra25 * (1.0 + 100.0 * motor.alpha_Ra) / motor.L
    rate += hidden.brush / (hidden.brush_knee * motor.L)
    rate += drive.dead_time / (drive.current_scale * motor.L)
    step = float(np.min([_FINENESS / rate, np.min(np.diff(time)) / _FEWEST]))
    numbers = asdict(motor) | asdict(hidden) | asdict(drive)
    plant = _Plant(**{name: float(numbers[name]) for name in _Plant._fields})
    out = _run(plant, time, wanted, temperature, noise, angle, step)
    if not np.isfinite(out).all():
        raise FloatingPointError(f"the simulation of {motor} with {hidden} is not finite")
    return Trajectory(*out)


@njit(cache=True)
def _rates(i, w, phi, f, v, s, loss, ra, kt, p):  # type: ignore[no-untyped-def]
    """Rates of current, speed, angle and filtered current; `s` is the sign of motion, 0 at rest."""
    duty = v / p.limit
    drop = p.brush * math.tanh(i / p.brush_knee)
    supply = v - p.source * duty * duty * i - p.dead_time * math.tanh(i / p.current_scale)
    di = (supply - ra * i - kt * w - drop) / p.L
    torque = kt * i - p.cogging * math.sin(p.cogging_order * phi)
    dw = 0.0 if s == 0.0 else (torque - p.b * w - s * loss) / p.J
    df = (i - f) / p.filter_time if p.filter_time > 0.0 else di
    return di, dw, w, df


@njit(cache=True)
def _step(i, w, phi, f, v, s, loss, ra, kt, p, h):  # type: ignore[no-untyped-def]
    """One step of the classical Runge-Kutta method."""
    i1, w1, x1, f1 = _rates(i, w, phi, f, v, s, loss, ra, kt, p)
    g = 0.5 * h
    i2, w2, x2, f2 = _rates(i + g * i1, w + g * w1, phi + g * x1, f + g * f1, v, s, loss, ra, kt, p)
    i3, w3, x3, f3 = _rates(i + g * i2, w + g * w2, phi + g * x2, f + g * f2, v, s, loss, ra, kt, p)
    i4, w4, x4, f4 = _rates(i + h * i3, w + h * w3, phi + h * x3, f + h * f3, v, s, loss, ra, kt, p)
    return (
        i + h * (i1 + 2.0 * i2 + 2.0 * i3 + i4) / 6.0,
        w + h * (w1 + 2.0 * w2 + 2.0 * w3 + w4) / 6.0,
        phi + h * (x1 + 2.0 * x2 + 2.0 * x3 + x4) / 6.0,
        f + h * (f1 + 2.0 * f2 + 2.0 * f3 + f4) / 6.0,
    )


@njit(cache=True)
def _asked(wanted, seen, integral, interval, p):  # type: ignore[no-untyped-def]
    """Command of the drive and the integral of its controller, which stops at the limit."""
    if p.proportional == 0.0:
        return wanted, integral
    error = wanted - seen
    command = p.proportional * error + integral
    limited = min(max(command, -p.limit), p.limit)
    if command == limited:
        integral += p.integral * error * interval
    return limited, integral


@njit(cache=True)
def _run(p, time, wanted, temperature, noise, angle, longest):  # type: ignore[no-untyped-def]
    """Signals (5, n_sample) of `Trajectory` in its order; `longest` is the longest step [s]."""
    out = np.empty((5, time.size))
    i, w, phi, f, rise, integral = 0.0, 0.0, angle, 0.0, 0.0, 0.0
    still = p.dry + p.stribeck
    s = 0.0
    for k in range(time.size):
        end = time[k + 1] if k + 1 < time.size else time[k] + longest
        command, integral = _asked(wanted[k], w + noise[k], integral, end - time[k], p)
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k] = command, i, f, w, phi
        v = 0.0 if abs(command) < p.dead_zone else command
        left = end - time[k]
        kt = p.Kt25 * (1.0 + p.alpha_Kt * (temperature[k] - 25.0))
        while left > 0.0:
            h = left if left < 1.001 * longest else longest
            ra = p.Ra25 * (1.0 + p.alpha_Ra * (temperature[k] + rise - 25.0))
            push = kt * i - p.cogging * math.sin(p.cogging_order * phi)
            if w == 0.0:
                s = 0.0 if still > 0.0 and abs(push) <= still else math.copysign(1.0, push)
            loss = p.dry + p.stribeck * math.exp(-((w / p.stribeck_speed) ** 2))
            after = _step(i, w, phi, f, v, s, loss, ra, kt, p, h)
            if still > 0.0 and s * after[1] < 0.0:
                if w != 0.0:
                    # The step ends when the shaft stops, because the friction changes its sign.
                    h *= w / (w - after[1])
                    after = _step(i, w, phi, f, v, s, loss, ra, kt, p, h)
                i, w, phi, f = after[0], 0.0, after[2], after[3]
            else:
                i, w, phi, f = after
            left -= h
            if p.heating > 0.0:
                rise += h * (p.heating * ra * i * i - rise) / p.heating_time
    return out
