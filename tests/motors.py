"""Motors with known parameters, and runs simulated from them.

The runs follow from the closed form of the two balances (eigenvalues of the 2x2 matrix of every
sample interval). The only code of the package in use is the class of a run.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.ingest.run import Run

__all__ = [
    "MOTORS",
    "NAMES",
    "Excitation",
    "Motor",
    "campaign",
    "drive",
    "driven",
    "motor_named",
    "noiseless",
    "run_of",
    "simulated",
]

Array = NDArray[np.float64]
Excitation = Literal["steps", "forward", "multisine", "binary"]
Hold = Literal["zoh", "foh"]

NAMES = ("Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L")
"""Order of the values of a motor."""


@dataclass(frozen=True)
class Motor:
    """A motor on a bench.

    Args:
        name: Name of the motor.
        values: Ra25 [ohm], alpha_Ra [1/K], Kt25 [N m/A], alpha_Kt [1/K], J [kg m^2],
            b [N m s/rad], L [H].
        voltage: Amplitude of the voltage [V].
        interval: Sample interval of the bench [s].
        dwell: Number of samples of a voltage step.
    """

    name: str
    values: tuple[float, float, float, float, float, float, float]
    voltage: float
    interval: float
    dwell: int = 50

    def warm(self, degrees: float) -> tuple[float, float, float, float, float]:
        """Ra, Kt, J, b and L at a temperature [degC]."""
        ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = self.values
        heat = degrees - 25.0
        return ra * (1 + alpha_ra * heat), kt * (1 + alpha_kt * heat), inertia, friction, inductance

    @property
    def vector(self) -> Array:
        """(7,) the values."""
        return np.array(self.values)


MOTORS = (
    Motor("watch 1 W", (15.0, 0.0039, 0.003, -0.0012, 2e-8, 5e-9, 1e-3), 3.0, 2e-4, 200),
    Motor("coreless 10 W", (2.5, 0.0039, 0.02, -0.0012, 8e-7, 1e-6, 2.5e-4), 12.0, 1e-4),
    Motor("ferrite 50 W", (1.8, 0.0039, 0.045, -0.0020, 2e-5, 2e-5, 3e-3), 24.0, 1e-3),
    Motor("servo 100 W", (0.6, 0.0039, 0.07, -0.0012, 1e-4, 1e-4, 2e-3), 24.0, 1e-3),
    Motor("samarium 400 W", (0.25, 0.0040, 0.12, -0.0004, 8e-4, 5e-4, 4e-4), 48.0, 5e-4, 80),
    Motor("paper", (0.59, 0.0040, 0.071, -0.0020, 0.01, 0.1, 0.5), 24.0, 1e-2, 100),
    Motor("pump 2 kW", (0.12, 0.0039, 0.3, -0.0020, 0.02, 0.01, 1.5e-3), 120.0, 1e-3, 100),
    Motor("traction 10 kW", (0.02, 0.0043, 0.5, -0.0010, 0.5, 0.02, 2e-4), 200.0, 2e-3, 60),
)
"""From an instrument motor to a traction motor: seven decades of inertia."""


def motor_named(name: str) -> Motor:
    """Return a motor of the table."""
    return next(motor for motor in MOTORS if motor.name == name)


def simulated(
    values: Array,
    interval: float,
    voltage: Array,
    temperature: Array,
    start: Array,
    hold: Hold = "zoh",
    magnet: Array | None = None,
) -> Array:
    """Current and speed at every sample, (n_sample, 2) [A, rad/s], exact for each interval.

    Args:
        values: (7,) in the order of `NAMES`.
        interval: Sample interval [s].
        voltage: (n_sample,) [V].
        temperature: (n_sample,) [degC]; within an interval the mean of its ends.
        start: (2,) current and speed at the first sample [A, rad/s].
        hold: Behaviour of the voltage between samples.
        magnet: (n_sample,) temperature of the magnet, where the winding has another [degC].
    """
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = values
    heat = 0.5 * (temperature[1:] + temperature[:-1]) - 25.0
    other = heat if magnet is None else 0.5 * (magnet[1:] + magnet[:-1]) - 25.0
    constant = kt * (1 + alpha_kt * other)
    matrix = np.zeros((heat.size, 2, 2), dtype=complex)
    matrix[:, 0, 0] = -ra * (1 + alpha_ra * heat) / inductance
    matrix[:, 0, 1] = -constant / inductance
    matrix[:, 1, 0] = constant / inertia
    matrix[:, 1, 1] = -friction / inertia
    eigenvalues, vectors = np.linalg.eig(matrix)
    inverse = np.linalg.inv(vectors)
    z = eigenvalues * interval
    phi0, phi1 = np.exp(z), np.expm1(z) / z
    phi2 = (phi1 - 1.0) / z
    through = inverse[:, :, 0] / inductance
    transition = np.einsum("nij,nj,njk->nik", vectors, phi0, inverse).real
    held = interval * np.einsum("nij,nj->ni", vectors, phi1 * through).real
    ramp = interval * np.einsum("nij,nj->ni", vectors, phi2 * through).real
    change = np.diff(voltage) if hold == "foh" else np.zeros(heat.size)
    push = held * voltage[:-1, None] + ramp * change[:, None]
    out = np.empty((voltage.size, 2))
    out[0] = start
    current, speed = (float(x) for x in start)
    rows = zip(transition.reshape(-1, 4).tolist(), push.tolist(), strict=True)
    for k, ((a, b, c, d), (e, f)) in enumerate(rows):
        current, speed = a * current + b * speed + e, c * current + d * speed + f
        out[k + 1] = current, speed
    return out


def drive(motor: Motor, kind: Excitation, rows: int, rng: np.random.Generator) -> Array:
    """Voltage that excites the motor, (rows,) [V].

    ``steps`` are random levels in both directions, ``forward`` in one direction only, ``binary``
    switches between two levels at random, and ``multisine`` has twelve frequencies.
    """
    spans = rows // motor.dwell + 1
    if kind == "steps":
        level = np.repeat(rng.uniform(-1.0, 1.0, spans), motor.dwell)[:rows]
    elif kind == "forward":
        level = np.repeat(rng.uniform(0.1, 1.0, spans), motor.dwell)[:rows]
    elif kind == "binary":
        level = np.repeat(rng.choice([-0.9, 0.9], 2 * spans), motor.dwell // 2)[:rows]
    else:
        time = np.arange(rows) * motor.interval
        lowest = 1.0 / (rows * motor.interval)
        tones = lowest * np.unique(np.geomspace(1, 0.1 * rows, 12).astype(int))
        phase = rng.uniform(0, 2 * np.pi, tones.size)
        level = np.sin(2 * np.pi * tones * time[:, None] + phase).sum(axis=1)
        level /= np.abs(level).max()
    return motor.voltage * level


def run_of(
    motor: Motor,
    voltage: Array,
    temperature: Array,
    start: Array,
    hold: Hold = "zoh",
    name: str = "run.csv",
) -> Run:
    """Run without noise."""
    clean = simulated(motor.vector, motor.interval, voltage, temperature, start, hold)
    time = motor.interval * np.arange(voltage.size, dtype=np.float64)
    return Run(name, "0" * 64, time, voltage, clean[:, 0], clean[:, 1], temperature)


def noiseless(
    motor: Motor,
    *,
    seed: int,
    runs: int = 3,
    rows: int = 1500,
    kind: Excitation = "steps",
    hold: Hold = "zoh",
    moving: bool = False,
) -> list[Run]:
    """Runs without noise whose temperatures rise from 25 to 115 degC in sequence.

    Args:
        motor: The motor.
        seed: Seed of the excitation.
        runs: Number of runs.
        rows: Samples of each.
        kind: Voltage.
        hold: Behaviour of the voltage between samples.
        moving: Whether the runs begin in motion.
    """
    rng = np.random.default_rng(seed)
    made = []
    for k in range(runs):
        voltage = drive(motor, kind, rows, rng)
        temperature = 25.0 + 90.0 * (k + np.linspace(0.0, 0.6, rows) ** 0.7) / runs
        start = np.zeros(2)
        if moving:
            top = motor.voltage / motor.values[2]
            start = np.array([0.2 * motor.voltage / motor.values[0], rng.uniform(0.1, 0.3) * top])
        made.append(run_of(motor, voltage, temperature, start, hold, f"run{k}.csv"))
    return made


def campaign(
    motor: Motor,
    *,
    seed: int,
    noise: float = 0.01,
    runs: int = 3,
    rows: int = 1500,
    kind: Excitation = "steps",
    hold: Hold = "zoh",
    moving: bool = False,
) -> list[Run]:
    """The runs of `noiseless` with normal noise and a temperature resolution of 0.1 degC.

    Args:
        motor: The motor.
        seed: Seed of excitation and noise.
        noise: Standard deviation of the noise of each channel, relative to that of the channel.
        runs: Number of runs.
        rows: Samples of each.
        kind: Voltage.
        hold: Behaviour of the voltage between samples.
        moving: Whether the runs begin in motion.
    """
    clean = noiseless(motor, seed=seed, runs=runs, rows=rows, kind=kind, hold=hold, moving=moving)
    rng = np.random.default_rng(seed + 10_000)
    current = noise * float(np.std(np.concatenate([run.current for run in clean])))
    speed = noise * float(np.std(np.concatenate([run.speed for run in clean])))
    logged = []
    for run in clean:
        assert run.temperature is not None
        logged.append(
            Run(
                run.name,
                run.sha256,
                run.time,
                run.voltage,
                run.current + current * rng.standard_normal(run.rows),
                run.speed + speed * rng.standard_normal(run.rows),
                np.round(run.temperature + 0.05 * rng.standard_normal(run.rows), 1),
            )
        )
    return logged


def driven(motor: Motor, rows: int, seed: int, warming: float) -> Run:
    """Run with inputs only: voltage steps while the motor warms from 60 degC."""
    voltage = drive(motor, "steps", rows, np.random.default_rng(seed))
    temperature = 60.0 + warming * motor.interval * np.arange(rows, dtype=np.float64)
    nothing = np.zeros(rows)
    time = motor.interval * np.arange(rows, dtype=np.float64)
    return Run("run.csv", "0" * 64, time, voltage, nothing, nothing, temperature)
