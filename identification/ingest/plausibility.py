"""Plausibility checks: reject impossible values and warn of unusual ones.

Voltage, current and speed alone cannot reveal a wrong unit: a scaled channel fits another motor
that obeys the same equations.  The bounds therefore cover all machines from instrument motors to
traction motors.  A logged position is compared with the integral of the speed; `checks` tests the
signs and the balances of all channels.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.errors import AbsurdValue, Example, RunFileError, of_file
from identification.ingest.faults import collected, refuse_all
from identification.ingest.run import RunWarning, SourceLocator
from identification.ingest.units import canonical_unit

__all__ = ["BOUNDS", "Bounds", "check_values"]


@dataclass(frozen=True)
class Bounds:
    """Accepted and usual range of a channel, in SI units."""

    possible: tuple[float, float]
    """Lowest and highest accepted value; a value outside raises an error."""
    usual: tuple[float, float]
    """Lowest and highest usual value; a value outside gives a warning."""
    hint: str
    """Most likely cause of a value outside."""
    unit: str
    """Most likely actual unit of a channel with an impossible value."""
    least: float = 0.0
    """Smallest usual peak magnitude of a run, zero for none."""
    small: str = ""
    """Most likely cause of a smaller peak."""


BOUNDS = {
    "voltage_V": Bounds(
        (-5e3, 5e3),
        (-1e3, 1e3),
        "is it in millivolts?",
        "mV",
        0.1,
        "is it in kilovolts, or the output of a voltage divider?",
    ),
    "current_A": Bounds(
        (-2e4, 2e4),
        (-2e3, 2e3),
        "is it in milliamperes?",
        "mA",
        1e-4,
        "is it in kiloamperes, or the output of a sensor in volts?",
    ),
    "speed_rad_s": Bounds(
        (-2e4, 2e4),
        (-5.5e3, 5.5e3),
        "is it in rpm or degrees per second?",
        "rpm",
        1e-2,
        "is it in krad/s, or the output of a tachogenerator?",
    ),
    "temperature_degC": Bounds(
        (-100.0, 300.0), (-60.0, 200.0), "is it in kelvin or Fahrenheit?", "K"
    ),
    "position_rad": Bounds((-1e12, 1e12), (-1e9, 1e9), "is it in encoder counts?", "deg"),
}
"""Bounds of every channel except time; docs/run-files.md prints them.

The least peaks have a basis in the slowest and smallest applications: brushed motors of 6 mm start
near 0.5 V and draw milliamperes without load, and the direct drive of a rate table or telescope
turns at 0.1 rad/s.  The limits are a fifth to a tenth of these.

The highest usual speed is that of coreless motors of drones; `checks.plausible` compares the speed
of each motor with that of motors of its size."""

# Range of motor temperatures in kelvin, from cold room to hot winding [K].
_KELVIN = (250.0, 430.0)
_NAMED_RATIOS = (
    (60.0 / (2.0 * math.pi), "rpm", "rpm"),
    (180.0 / math.pi, "degrees per second", "deg/s"),
)
_RATIO_TOLERANCE = 0.03


def check_values(
    channels: dict[str, Array], time: Array, locator: SourceLocator, constants: Collection[str] = ()
) -> Iterator[RunWarning]:
    """Reject impossible values and warn of unusual ones, for all channels except time, in SI units.

    The channels of `constants` are constant by the mapping.

    Raises:
        AbsurdValue: A value is outside the possible range, or two channels contradict each other.
    """
    errors: list[RunFileError] = []
    for name, signal in channels.items():
        with collected(errors):
            if name == "temperature_degC":
                _refuse_kelvin(signal, locator)
            yield from _check_bounds(name, signal, locator)
    refuse_all(errors)
    logged = {name: signal for name, signal in channels.items() if name not in constants}
    yield from _check_movement(logged, locator)
    yield from _check_same(channels, locator)
    if "position_rad" in channels and "speed_rad_s" not in locator.derived:
        yield from _check_position(channels["position_rad"], channels["speed_rad_s"], time, locator)


def _correction(name: str, locator: SourceLocator, unit: str) -> Example:
    """Mapping that reads a channel of this file, or the origin of a derived one, otherwise."""
    origin = locator.derived.get(name, name)
    remedy = {"unit": unit} if origin == name else {"scale": "SCALE"}
    return of_file(locator.file, {origin: {"column": locator.columns[origin], **remedy}})


def _hint(name: str, locator: SourceLocator) -> str:
    """Most likely cause of a value outside the bounds of a channel."""
    derived = f"is the scale of {locator.derived.get(name)} right?"
    return derived if name in locator.derived else BOUNDS[name].hint


def _refuse_kelvin(temperature: Array, locator: SourceLocator) -> None:
    low, high = float(np.min(temperature)), float(np.max(temperature))
    if _KELVIN[0] < low and high < _KELVIN[1]:
        raise locator.error(
            AbsurdValue,
            f"the temperatures from {low:.4g} to {high:.4g} degC are probably in kelvin; "
            "give the unit in the header",
            "temperature_degC",
            0,
            low,
            [_correction("temperature_degC", locator, "K")],
        )


def _check_bounds(name: str, signal: Array, locator: SourceLocator) -> Iterator[RunWarning]:
    bounds = BOUNDS[name]
    unit = canonical_unit(name).name
    outside = np.flatnonzero((signal < bounds.possible[0]) | (signal > bounds.possible[1]))
    if outside.size:
        sample = int(outside[0])
        value = float(signal[sample])
        raise locator.error(
            AbsurdValue,
            f"{value:.6g} {unit} is impossible for a brushed motor; expected "
            f"{bounds.possible[0]:g} to {bounds.possible[1]:g} {unit}; {_hint(name, locator)} "
            "Correct the value or the header",
            name,
            sample,
            value,
            [_correction(name, locator, bounds.unit)],
        )
    unusual = (signal < bounds.usual[0]) | (signal > bounds.usual[1])
    if np.any(unusual):
        worst = int(np.argmax(np.abs(np.where(unusual, signal, 0.0))))
        yield locator.warning(
            "suspicious_value",
            f"reaches {signal[worst]:.6g} {unit}, unusual for a brushed motor; "
            f"{_hint(name, locator)}",
            name,
            worst,
        )
    largest = float(np.max(np.abs(signal)))
    if 0.0 < largest < bounds.least:
        yield locator.warning(
            "suspicious_value",
            f"never exceeds {largest:.4g} {unit}, at least {bounds.least:g} {unit} is usual for a "
            f"driven motor; {_hint(name, locator) if name in locator.derived else bounds.small}",
            name,
        )


def _check_movement(channels: dict[str, Array], locator: SourceLocator) -> Iterator[RunWarning]:
    """Warn of constant channels, except temperature, which a climate chamber holds constant."""
    for name, signal in channels.items():
        if name != "temperature_degC" and np.ptp(signal) == 0.0:
            yield locator.warning(
                "constant_channel",
                f"is constant: all samples are {signal[0] + 0.0:.6g}; "
                "check that the sensor was connected, unless this is intended",
                name,
            )


def _check_same(channels: dict[str, Array], locator: SourceLocator) -> Iterator[RunWarning]:
    """Warn of two channels with identical values: one signal was exported twice."""
    for first, second in itertools.combinations(channels, 2):
        if np.ptp(channels[first]) > 0.0 and np.array_equal(channels[first], channels[second]):
            yield locator.warning(
                "identical_channels",
                f"has the same samples as {locator.columns[first]}; "
                "check that the correct signal was exported",
                second,
            )


def _check_position(
    position: Array, speed: Array, time: Array, locator: SourceLocator
) -> Iterator[RunWarning]:
    """Compare the change of position with the integral of the speed."""
    interval = np.diff(time)
    steps = np.diff(position)
    wraps = np.abs(steps) > np.pi
    # Exclude wraps of an angle logged over one turn, and differences across a gap.
    sound = ~wraps & (interval <= 2.0 * float(np.median(interval)))
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * interval)))
    expected = np.diff(turned)[sound]
    weight = float(np.sum(expected**2))
    if weight == 0.0 or np.ptp(position) == 0.0 or float(np.sum(np.abs(expected))) < 1.0:
        return
    slope = float(np.sum(expected * steps[sound])) / weight
    for factor, unit, symbol in _NAMED_RATIOS:
        if slope > 0.0 and abs(1.0 / slope / factor - 1.0) < _RATIO_TOLERANCE:
            raise locator.error(
                AbsurdValue,
                f"the integral of the speed is {1.0 / slope:.4g} times the change of position, so "
                f"the speed is in {unit}; give its unit in the header",
                "speed_rad_s",
                0,
                1.0 / slope,
                [_correction("speed_rad_s", locator, symbol)],
            )
    if not abs(slope - 1.0) < 0.2:  # also if it is NaN
        yield locator.warning(
            "position_disagrees",
            f"the change of position is {slope:.4g} times the integral of the speed, expected 1; "
            "check the units, the signs and the gear ratio between the two sensors",
            "position_rad",
        )
