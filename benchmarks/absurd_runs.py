"""Random campaigns, from ordinary to absurd: input of `benchmarks.fuzz_fits`.

    case = drawn(17)
    identify(case.training, case.validation, case.options)

A run is simulated with a linear motor and a random voltage.  Then zero to three faults of `FAULTS`
are applied: a constant channel, a copy, swapped channels, an outlier of 1e9, one bit of
resolution.  The same seed gives the same campaign.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from identification import FitOptions, Run

__all__ = ["EXCITATIONS", "FAULTS", "Case", "drawn"]

Array = NDArray[np.float64]
Random = np.random.Generator

_CHANNELS: Final = ("voltage", "current", "speed")
_HOLDS: Final[tuple[Literal["auto", "zoh", "foh"], ...]] = ("auto", "auto", "zoh", "foh")


@dataclass(frozen=True)
class Case:
    """One campaign.

    Args:
        seed: Seed that determines the campaign.
        training: Training runs.
        validation: Validation runs.
        options: Options of the fit.
        faults: Excitation and faults of each run, as text.
    """

    seed: int
    training: tuple[Run, ...]
    validation: tuple[Run, ...]
    options: FitOptions
    faults: tuple[str, ...]

    @property
    def words(self) -> str:
        """Description of the campaign on one line."""
        rows = "+".join(str(run.rows) for run in (*self.training, *self.validation))
        options = "effects" if self.options.effects else "no effects"
        options += ", posterior" if self.options.posterior else ""
        return (
            f"{rows} rows, {len(self.validation)} validation, {options}; {'; '.join(self.faults)}"
        )


def drawn(seed: int, rows: int = 2000, effects: float = 0.4, posterior: float = 0.03) -> Case:
    """Draw the campaign of a seed.

    Args:
        seed: Seed.
        rows: Maximum number of samples of a run.
        effects: Fraction of the campaigns with a search for effects.
        posterior: Fraction of the campaigns with sampling; their runs have at most 300 samples.
    """
    random = np.random.default_rng(seed)
    options = FitOptions(
        seed=seed,
        effects=bool(random.random() < effects),
        posterior=bool(random.random() < posterior),
        hold=_HOLDS[random.integers(len(_HOLDS))],
        temperatures=(25.0,) if random.random() < 0.8 else (25.0, 125.0),
        controllers=(str(random.choice(["P:1", "P:1", "P:1", "PI:0.5,2", "PID:1,0.1,0.01"])),),
    )
    most = min(rows, 300) if options.posterior else rows
    motors = [_motor(random) for _ in range(1 + (random.random() < 0.1))]
    training, validation, faults = [], [], []
    for k in range(1 + int(random.choice([0, 0, 0, 1, 2, 3]))):
        run, words = _run(random, motors[k % len(motors)], f"training_{k}.csv", most)
        training.append(run)
        faults.append(words)
    for k in range(int(random.choice([0, 0, 1, 2]))):
        run, words = _run(random, motors[-1], f"validation_{k}.csv", most)
        validation.append(run)
        faults.append(f"validation {words}")
    if random.random() < 0.05:
        training.append(replace(training[0], name="again.csv"))
        faults.append("the first once more")
    return Case(seed, tuple(training), tuple(validation), options, tuple(faults))


def _motor(random: Random) -> Array:
    """Ra [ohm], Kt [N m/A], J [kg m^2], b [N m s/rad], L [H], from watch to traction motor."""
    resistance, constant = 10 ** random.uniform(-1.5, 1.5), 10 ** random.uniform(-2.5, 0.0)
    mechanical, electrical = 10 ** random.uniform(-2, 0), 10 ** random.uniform(-4, -1)
    inertia = mechanical * constant**2 / resistance
    friction = 10 ** random.uniform(-3, 0) * constant**2 / resistance
    return np.array([resistance, constant, inertia, friction, electrical * resistance])


def _run(random: Random, motor: Array, name: str, most: int) -> tuple[Run, str]:
    count = int(10 ** random.uniform(np.log10(50), np.log10(most)))
    # About 1/50 of the mechanical time constant, up to 30 times faster or slower.
    interval = motor[2] * motor[0] / motor[1] ** 2 / 50 * 10 ** random.uniform(-1.5, 1.5)
    kind = str(random.choice(list(EXCITATIONS)))
    voltage = 12.0 * EXCITATIONS[kind](random, count)
    logged = _simulated(motor, interval, voltage)
    noise = 10 ** random.uniform(-5, -1) * logged.std(axis=0)
    logged = logged + noise * random.standard_normal(logged.shape)
    time = interval * np.arange(count)
    run = Run(
        name=name,
        sha256="",
        time=time,
        voltage=voltage,
        current=logged[:, 0],
        speed=logged[:, 1],
        temperature=_temperature(random, count),
        position=interval * np.cumsum(logged[:, 1]) if random.random() < 0.3 else None,
    )
    words = [kind]
    for _ in range(int(random.choice([0, 1, 1, 2, 3]))):
        fault = str(random.choice(list(FAULTS)))
        run = FAULTS[fault](random, run)
        words.append(fault)
    content = np.concatenate([run.time, run.voltage, run.current, run.speed])
    return replace(run, sha256=hashlib.sha256(content.tobytes()).hexdigest()), ", ".join(words)


def _simulated(motor: Array, interval: float, voltage: Array) -> Array:
    """(n_sample, 2) current and speed from rest, with zero-order hold."""
    resistance, constant, inertia, friction, inductance = motor
    whole = np.zeros((3, 3))
    whole[0] = [-resistance / inductance, -constant / inductance, 1 / inductance]
    whole[1, :2] = [constant / inertia, -friction / inertia]
    step = expm(whole * interval)
    state, logged = np.zeros(2), np.empty((voltage.size, 2))
    for k, value in enumerate(voltage):
        logged[k] = state
        state = step[:2, :2] @ state + step[:2, 2] * value
    return logged


def _temperature(random: Random, count: int) -> Array | None:
    start, end = random.uniform(-20, 120, 2)
    line: Array = np.linspace(start, end, count, dtype=np.float64)
    if random.random() < 0.2:
        return None
    kinds: tuple[Array, ...] = (
        np.full(count, 25.0),
        np.full(count, start),
        line,
        line.round(),
        start + np.cumsum(random.standard_normal(count)),
    )
    return kinds[int(random.integers(len(kinds)))]


def _steps(random: Random, count: int) -> Array:
    dwell = max(count // 12, 1)
    return np.repeat(random.uniform(-1, 1, count // dwell + 1), dwell)[:count]


def _late(random: Random, count: int) -> Array:
    return np.where(np.arange(count) < count - 2, 0.0, 1.0)


EXCITATIONS: Final[dict[str, Callable[[Random, int], Array]]] = {
    "steps": _steps,
    "one direction": lambda random, count: np.abs(_steps(random, count)),
    "binary": lambda random, count: random.choice([-1.0, 1.0], count),
    "sine": lambda random, count: np.sin(np.arange(count) * random.uniform(0.01, 3)),
    "constant": lambda random, count: np.ones(count),
    "one step": lambda random, count: np.where(np.arange(count) < count // 3, 0.0, 1.0),
    "no motion": lambda random, count: np.zeros(count),
    "motion in the last sample": _late,
    "tiny": lambda random, count: 1e-9 * _steps(random, count),
}
"""Voltage by excitation, (n_sample,), at most 1."""


def _changed(run: Run, **channels: object) -> Run:
    """Copy a run with changed channels; a typed `dataclasses.replace`."""
    fields: dict[str, Any] = channels
    return replace(run, **fields)


def _on_one(change: Callable[[Random, Array], Array]) -> Callable[[Random, Run], Run]:
    """Fault of one randomly drawn channel."""

    def fault(random: Random, run: Run) -> Run:
        name = str(random.choice(_CHANNELS))
        changed = change(random, np.asarray(getattr(run, name)).copy())
        return _changed(run, **{name: np.asarray(changed, dtype=np.float64)})

    return fault


def _spike(size: float) -> Callable[[Random, Array], Array]:
    def change(random: Random, values: Array) -> Array:
        values[random.integers(values.size)] = size
        return values

    return change


def _quantised(levels: int) -> Callable[[Random, Array], Array]:
    def change(random: Random, values: Array) -> Array:
        step = np.ptp(values) / levels or 1.0
        return step * np.round(values / step)

    return change


def _swapped(random: Random, run: Run) -> Run:
    one, other = (str(name) for name in random.choice(_CHANNELS, 2, replace=False))
    return _changed(run, **{one: getattr(run, other), other: getattr(run, one)})


def _copied(random: Random, run: Run) -> Run:
    one, other = (str(name) for name in random.choice(_CHANNELS, 2, replace=False))
    return _changed(run, **{one: np.asarray(getattr(run, other)).copy()})


def _scaled(factor: float) -> Callable[[Random, Run], Run]:
    def fault(random: Random, run: Run) -> Run:
        name = str(random.choice([*_CHANNELS, "time"]))
        return _changed(run, **{name: factor * getattr(run, name)})

    return fault


def _gaps(random: Random, run: Run) -> Run:
    at = int(random.integers(1, run.rows))
    moved = run.time + np.where(np.arange(run.rows) < at, 0.0, 100 * np.ptp(run.time))
    return replace(run, time=moved, segments=((0, at), (at, run.rows)))


def _jittered(random: Random, run: Run) -> Run:
    """Sample times with intervals over four decades, all above the rounding error."""
    steps = np.diff(run.time, prepend=0.0) * 10 ** random.uniform(-2, 2, run.rows)
    return replace(run, time=np.cumsum(steps) + 1e-9 * np.arange(run.rows))


def _clipped(random: Random, run: Run) -> Run:
    name = str(random.choice(["current", "speed"]))
    values = np.asarray(getattr(run, name))
    low, high = np.quantile(values, sorted(random.uniform(0, 1, 2)))
    mask = {"current": "current_A", "speed": "speed_rad_s"}[name]
    out = (values <= low) | (values >= high)
    clipped = {**run.clipped, mask: out}
    return _changed(run, **{name: np.clip(values, low, high)}, clipped=clipped)


def _hot(random: Random, run: Run) -> Run:
    return replace(run, temperature=np.full(run.rows, random.choice([-273.0, 1e4, 1e-300])))


def _turned(random: Random, run: Run) -> Run:
    position = random.choice([0.0, 1e12, 1.0]) * np.ones(run.rows)
    return replace(run, position=position + random.choice([0.0, 1.0]) * np.arange(run.rows))


FAULTS: Final[dict[str, Callable[[Random, Run], Run]]] = {
    "constant channel": _on_one(lambda random, v: np.full(v.size, v[-1])),
    "zero channel": _on_one(lambda random, v: np.zeros(v.size)),
    "channel at one": _on_one(lambda random, v: np.ones(v.size)),
    "saturated": _on_one(lambda random, v: np.clip(v, *np.quantile(v, [0.4, 0.6]))),
    "copied": _copied,
    "swapped": _swapped,
    "negated": _on_one(lambda random, v: -v),
    "scaled by 1e-6": _scaled(1e-6),
    "scaled by 1e6": _scaled(1e6),
    "spike of 1e9": _on_one(_spike(1e9)),
    "spike of 1e14": _on_one(_spike(1e14)),
    "denormal": _on_one(lambda random, v: 5e-324 * np.round(3 * v / (np.ptp(v) or 1.0))),
    "random walk": _on_one(lambda random, v: np.cumsum(random.standard_normal(v.size))),
    "noise": _on_one(lambda random, v: random.standard_normal(v.size)),
    "steps": _on_one(lambda random, v: _steps(random, v.size)),
    "integers": _on_one(lambda random, v: np.round(v)),
    "one bit": _on_one(_quantised(1)),
    "two bits": _on_one(_quantised(3)),
    "offset of 1e6": _on_one(lambda random, v: v + 1e6),
    "delayed": _on_one(lambda random, v: np.roll(v, int(random.integers(1, 20)))),
    "reversed": _on_one(lambda random, v: v[::-1]),
    "gap": _gaps,
    "jitter": _jittered,
    "clipped": _clipped,
    "absurd temperature": _hot,
    "absurd position": _turned,
}
"""Faults that are applied to a run."""
