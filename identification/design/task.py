"""Task of a design: models, quantity, limits and grid of the run, from a result or a nameplate.

The syntax of limits is ``voltage=24,current=10,...``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Final

import numpy as np

from identification.design.models import (
    DesignModel,
    Quantity,
    models_of,
    nameplate_models,
    quantity_of,
    time_constants,
)
from identification.design.response import Conditions
from identification.errors import InputError, OptionError
from identification.nameplate import nameplate_of
from identification.numerals import decimal_of
from identification.prediction import hottest_of
from identification.speed_loop.spread import checked_temperatures

__all__ = ["UNITS", "DesignOptions", "Limits", "Task", "task_of_nameplate", "task_of_result"]

UNITS: Final = {
    "voltage": "V",
    "current": "A",
    "speed": "rad/s",
    "slew": "V/s",
    "position": "rad",
    "load": "N m",
}
_MOST_MODELS: Final = 6
_FEWEST_ROWS: Final = 100
_MOST_ROWS: Final = 50_000
_USUAL_ROWS: Final = 3000
"""Samples of a run if neither rate nor duration is given, at most."""
_SAME_TEMPERATURE: Final = 3.0
_NOISE: Final = 0.005
"""Noise of current and speed over stall current and no-load speed, without any run [-]."""
_OVERSPEED: Final = 1.1


@dataclass(frozen=True)
class Limits:
    """Largest magnitudes in a run; infinite without a limit."""

    voltage: float
    """Voltage [V]."""
    current: float = math.inf
    """Current [A]."""
    speed: float = math.inf
    """Speed [rad/s]."""
    slew: float = math.inf
    """Rate of change of the voltage [V/s]."""
    position: float = math.inf
    """Distance of the shaft from its angle at the start [rad]."""
    load: float = 0.0
    """Constant torque that the bench can put on the shaft, in either direction; zero without a
    brake or drive [N m]."""

    def entry(self) -> dict[str, float | None]:
        """The limits by name; null without a limit, or without a load."""
        return {k: v if 0.0 < v < math.inf else None for k, v in asdict(self).items()}


def limits_of(words: Sequence[str]) -> dict[str, float]:
    """Limits from ``NAME=VALUE,...``; several texts are joined.

    Raises:
        OptionError: A name is unknown or repeated, or a value is not a positive number.
    """
    found: dict[str, float] = {}
    names = [field.name for field in fields(Limits)]
    for part in (part.strip() for word in words for part in word.split(",")):
        name, _, text = (piece.strip() for piece in part.partition("="))
        if name not in names or name in found:
            raise OptionError(
                f"limit {part[:60]!r}: expected NAME=VALUE, once each, with a name of "
                f"{', '.join(f'{n} [{UNITS[n]}]' for n in names)}",
                value=part,
            )
        try:
            found[name] = decimal_of(text)
        except ValueError:
            found[name] = math.nan
        if not 1e-9 <= found[name] <= 1e9:
            raise OptionError(
                f"limit {part[:60]!r}: expected a positive number in {UNITS[name]}", value=part
            )
    return found


@dataclass(frozen=True)
class DesignOptions:
    """Options of a design."""

    limits: tuple[str, ...] = ()
    """Limits, ``NAME=VALUE,...``; those left open are the largest values of the earlier runs, or
    those of the nameplate."""
    duration: float | None = None
    """Duration [s]; None for that of the earlier runs."""
    rate: float | None = None
    """Sample rate [Hz]; None for that of the earlier runs."""
    temperatures: tuple[float, ...] = ()
    """Temperatures that the bench can hold [degC]; empty for those of the earlier runs."""
    narrow: str = ""
    """Quantity to narrow; empty for all parameters of the final model."""
    seed: int = 0
    """Seed of the random candidates and of the draws."""

    def __post_init__(self) -> None:
        for name, value, unit in (("duration", self.duration, "s"), ("rate", self.rate, "Hz")):
            if value is not None and not 0.0 < value < math.inf:
                raise OptionError(
                    f"{name} is {value:g} {unit}; expected a positive number in {unit}", value=value
                )
        if not 0 <= self.seed < 2**32:
            raise OptionError(
                f"seed is {self.seed}; expected a whole number from 0 to 4294967295",
                value=self.seed,
            )
        limits_of(self.limits)
        if self.temperatures:
            checked_temperatures(self.temperatures)


@dataclass(frozen=True, kw_only=True)
class Task(Conditions):
    """What a run is designed for."""

    models: tuple[DesignModel, ...]
    """Final model and its alternatives, or the same motor with several guesses."""
    are_rivals: bool
    """True if the models exclude each other, so that the run has to separate them."""
    quantity: Quantity | None
    """Quantity to narrow; None for all parameters."""
    limits: Limits
    rows: int
    temperatures: tuple[float, ...]
    """Temperatures to choose from [degC]."""
    seed: int = 0

    @property
    def duration(self) -> float:
        """Duration of the run [s]."""
        return self.rows * self.interval

    @property
    def loads(self) -> tuple[float, ...]:
        """Load torques to choose from, besides none [N m]."""
        return tuple(share * self.load for share in (-1.0, -0.5, 0.5, 1.0)) if self.load else ()


def task_of_result(result: Mapping[str, Any], options: DesignOptions) -> Task:
    """Task from a result: separate the alternatives of its effects and narrow its parameters.

    Raises:
        InputError: The result lacks its models, noise or runs.
        OptionError: An option is not accepted.
    """
    models = models_of(result)
    models = [models[0], *sorted(models[1:], key=lambda one: -one.probability)][:_MOST_MODELS]
    noise = [(result.get("noise") or {}).get(name) for name in ("current_A", "speed_rad_s")]
    if not all(isinstance(value, int | float) and value > 0 for value in noise):
        raise InputError("the result has no noise of current and speed; repeat the fit")
    runs = [run for run in result.get("runs") or () if run.get("sample_rate_hz")]
    if not runs:
        raise InputError("the result has no run with a sample rate; repeat the fit")
    ranges = [run.get("ranges") or {} for run in runs]
    known = {
        name: _largest(ranges, channel)
        for name, channel in (
            ("voltage", "voltage_V"), ("current", "current_A"), ("speed", "speed_rad_s")
        )
    }  # fmt: skip
    rates = [run["sample_rate_hz"] for run in runs]
    spans = [run["rows"] / run["sample_rate_hz"] for run in runs]
    fast, _ = time_constants(models)
    rows, interval = _grid(options, float(np.median(rates)), float(np.median(spans)), fast)
    controllers = (result.get("options") or {}).get("controllers") or ["P:1"]
    limits = _limits(options, known)
    return Task(
        models=tuple(models),
        are_rivals=len(models) > 1,
        quantity=quantity_of(options.narrow, models[0], controllers[0]) if options.narrow else None,
        limits=limits,
        load=limits.load,
        rows=rows,
        interval=interval,
        temperatures=tuple(options.temperatures) or _logged_temperatures(ranges),
        noise=np.array(noise, dtype=np.float64),
        seed=options.seed,
        earlier=len(result["runs"]),
        hottest=hottest_of(runs, -np.inf),
    )


def task_of_nameplate(text: str, options: DesignOptions) -> Task:
    """Task of the first run of a motor: narrow the parameters that a nameplate leaves open.

    Raises:
        OptionError: The nameplate or an option is not accepted.
    """
    if not text.strip():
        raise OptionError("the nameplate is empty; expected KEY=VALUE,...", value=text)
    plate = nameplate_of(text)
    if plate.voltage is None or plate.resistance is None or plate.constant is None:
        raise OptionError(
            f"nameplate {text[:120]!r}: a first run needs voltage, no_load_speed and "
            "stall_current, or a rated point in place of the stall current",
            value=text,
        )
    stall, speed = plate.voltage / plate.resistance, plate.voltage / plate.constant
    models = nameplate_models(plate, stall)
    fast, slow = time_constants(models)
    rows, interval = _grid(options, 1000.0, max(10.0 * slow, 2.0), fast)
    known = {"voltage": plate.voltage, "current": stall, "speed": _OVERSPEED * speed}
    limits = _limits(options, known)
    return Task(
        models=tuple(models),
        are_rivals=False,
        quantity=quantity_of(options.narrow, models[1], "P:1") if options.narrow else None,
        limits=limits,
        load=limits.load,
        rows=rows,
        interval=interval,
        temperatures=tuple(options.temperatures) or (25.0,),
        noise=_NOISE * np.array([stall, speed]),
        seed=options.seed,
    )


def _largest(ranges: Sequence[Mapping[str, Sequence[float]]], channel: str) -> float | None:
    found = [max(abs(low), abs(high)) for one in ranges for low, high in [one.get(channel, (0, 0))]]
    return max(found, default=0.0) or None


def _limits(options: DesignOptions, known: Mapping[str, float | None]) -> Limits:
    """Given limits, completed by those known of the motor."""
    found = {name: value for name, value in known.items() if value} | limits_of(options.limits)
    if "voltage" not in found:
        raise OptionError(
            f"no voltage limit is known; give one, such as --limit voltage=24 [{UNITS['voltage']}]"
        )
    return Limits(**found)


def _grid(options: DesignOptions, rate: float, duration: float, fast: float) -> tuple[int, float]:
    """Number of samples and sample interval [s].

    `duration` is the usual one, `fast` the shortest time constant of the motor [s].

    Raises:
        OptionError: There are too few or too many samples, or the run is too short for the motor.
    """
    rate = options.rate or rate
    rows = round(rate * (options.duration or min(duration, _USUAL_ROWS / rate)))
    if not _FEWEST_ROWS <= rows <= _MOST_ROWS:
        raise OptionError(
            f"duration times rate gives {rows} samples; expected {_FEWEST_ROWS} to {_MOST_ROWS}",
            value=rows,
        )
    if rows < fast * rate:
        raise OptionError(
            f"the run lasts {rows / rate:.3g} s ({rows} samples at {rate:.4g} Hz); expected more "
            f"than {fast:.3g} s, the shortest time constant of the motor; give a longer duration "
            "or a lower rate",
            value=rows / rate,
        )
    return rows, 1.0 / rate


def _logged_temperatures(ranges: Sequence[Mapping[str, Sequence[float]]]) -> tuple[float, ...]:
    """Lowest and highest temperature of the earlier runs, one if they are close."""
    logged = [value for one in ranges for value in one.get("temperature_degC", ())]
    if not logged:
        return (25.0,)
    low, high = (float(round(value)) for value in (min(logged), max(logged)))
    return (low, high) if high - low > _SAME_TEMPERATURE else (low,)
