"""Plausibility checks: reject impossible values and warn of unusual ones.

Voltage, current and speed alone cannot reveal a wrong unit: a scaled channel fits another motor
that obeys the same equations.  The bounds therefore cover all machines from instrument motors to
traction motors.  Two checks between channels are possible: `polarity` tests the signs, and this
module compares a logged position with the integral of the speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import AbsurdValue
from identification.ingest.place import Places
from identification.ingest.polarity import check_polarity
from identification.ingest.run import RunWarning

__all__ = ["BOUNDS", "Bounds", "check_values"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bounds:
    """Accepted and usual range of a channel, in SI units.

    Args:
        possible: Lowest and highest accepted value; a value outside raises an error.
        usual: Lowest and highest usual value; a value outside gives a warning.
        hint: Most likely cause of a value outside.
    """

    possible: tuple[float, float]
    usual: tuple[float, float]
    hint: str


BOUNDS = {
    "voltage_V": Bounds((-5e3, 5e3), (-1e3, 1e3), "is it in millivolts?"),
    "current_A": Bounds((-2e4, 2e4), (-2e3, 2e3), "is it in milliamperes?"),
    "speed_rad_s": Bounds((-2e4, 2e4), (-2.5e3, 2.5e3), "is it in rpm or degrees per second?"),
    "temperature_degC": Bounds((-100.0, 300.0), (-60.0, 200.0), "is it in kelvin or Fahrenheit?"),
    "position_rad": Bounds((-1e12, 1e12), (-1e9, 1e9), "is it in encoder counts?"),
}
"""Bounds of every channel except time; docs/run-files.md prints them."""

_OTHER_UNITS = {
    "voltage_V": "mV",
    "current_A": "mA",
    "speed_rad_s": "rpm",
    "temperature_degC": "K",
    "position_rad": "deg",
}
"""Most likely actual unit of a channel with an impossible value."""

# Range of motor temperatures in kelvin, from cold room to hot winding [K].
_KELVIN = (250.0, 430.0)
_SMALLEST_VOLTAGE = 0.1
_NAMED_RATIOS = ((60.0 / (2.0 * math.pi), "rpm"), (180.0 / math.pi, "degrees per second"))
_RATIO_TOLERANCE = 0.03


def check_values(channels: dict[str, Array], time: Array, places: Places) -> list[RunWarning]:
    """Reject impossible values and warn of unusual ones.

    Args:
        channels: Channel name to (n_sample,), in SI units, without time.
        time: (n_sample,) strictly increasing [s].
        places: Source locations of the samples.

    Returns:
        Warnings.

    Raises:
        AbsurdValue: A value is outside the possible range, or two channels contradict each other.
    """
    warnings = []
    for name, signal in channels.items():
        if name == "temperature_degC":
            _refuse_kelvin(signal, places)
        warnings += _check_bounds(name, signal, places)
    warnings += _check_movement(channels, places)
    warnings += _check_small_voltage(channels["voltage_V"], places)
    warnings += check_polarity(channels, time, places)
    warnings += _check_same(channels, places)
    if "position_rad" in channels:
        warnings += _check_position(channels, time, places)
    return warnings


def _correction(name: str, places: Places, unit: str) -> str:
    """Command-line option that reads a channel of this file in another unit."""
    return f"--map '{places.file}:{name}={places.columns.get(name, name)} in {unit}'"


def _refuse_kelvin(temperature: Array, places: Places) -> None:
    low, high = float(np.min(temperature)), float(np.max(temperature))
    if _KELVIN[0] < low and high < _KELVIN[1]:
        raise places.error(
            AbsurdValue,
            f"the temperatures from {low:.4g} to {high:.4g} degC are probably in kelvin; "
            f"give the unit in the header or with {_correction('temperature_degC', places, 'K')}",
            "temperature_degC",
            0,
            low,
        )


def _check_bounds(name: str, signal: Array, places: Places) -> list[RunWarning]:
    bounds = BOUNDS[name]
    unit = "degC" if name == "temperature_degC" else name.split("_", 1)[1].replace("_", "/")
    outside = np.flatnonzero((signal < bounds.possible[0]) | (signal > bounds.possible[1]))
    if outside.size:
        sample = int(outside[0])
        value = float(signal[sample])
        raise places.error(
            AbsurdValue,
            f"{value:.6g} {unit} is impossible for a brushed motor; expected "
            f"{bounds.possible[0]:g} to {bounds.possible[1]:g} {unit}; {bounds.hint} Correct the "
            f"value, or the unit with {_correction(name, places, _OTHER_UNITS[name])}",
            name,
            sample,
            value,
        )
    unusual = (signal < bounds.usual[0]) | (signal > bounds.usual[1])
    if not np.any(unusual):
        return []
    worst = int(np.argmax(np.abs(np.where(unusual, signal, 0.0))))
    return [
        places.warning(
            "suspicious_value",
            f"reaches {signal[worst]:.6g} {unit}, unusual for a brushed motor; {bounds.hint}",
            name,
            worst,
        )
    ]


def _check_movement(channels: dict[str, Array], places: Places) -> list[RunWarning]:
    """Warn of constant channels, except temperature, which a climate chamber holds constant."""
    return [
        places.warning(
            "constant_channel",
            f"is constant: all samples are {signal[0] + 0.0:.6g}; "
            "check that the sensor was connected, unless this is intended",
            name,
        )
        for name, signal in channels.items()
        if name != "temperature_degC" and np.ptp(signal) == 0.0
    ]


def _check_small_voltage(voltage: Array, places: Places) -> list[RunWarning]:
    largest = float(np.max(np.abs(voltage)))
    if largest == 0.0 or largest >= _SMALLEST_VOLTAGE:
        return []
    return [
        places.warning(
            "suspicious_value",
            f"never exceeds {largest:.4g} V, unusual for a driven motor; "
            "is it in kilovolts, or the output of a voltage divider?",
            "voltage_V",
        )
    ]


def _check_same(channels: dict[str, Array], places: Places) -> list[RunWarning]:
    """Warn of two channels with identical values: one signal was exported twice."""
    names = list(channels)
    return [
        places.warning(
            "identical_channels",
            f"has the same samples as {places.columns.get(first, first)}; "
            "check that the correct signal was exported",
            second,
        )
        for at, first in enumerate(names)
        for second in names[at + 1 :]
        if np.ptp(channels[first]) > 0.0 and np.array_equal(channels[first], channels[second])
    ]


def _check_position(channels: dict[str, Array], time: Array, places: Places) -> list[RunWarning]:
    """Compare the change of position with the integral of the speed."""
    position = channels["position_rad"]
    speed = channels["speed_rad_s"]
    interval = np.diff(time)
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * interval)))
    steps = np.diff(position)
    wraps = np.abs(steps) > np.pi
    # Exclude wraps of an angle logged over one turn, and differences across a gap.
    sound = ~wraps & (interval <= 2.0 * float(np.median(interval)))
    expected = np.diff(turned)[sound]
    weight = float(np.sum(expected**2))
    if weight == 0.0 or np.ptp(position) == 0.0 or float(np.sum(np.abs(expected))) < 1.0:
        return []
    slope = float(np.sum(expected * steps[sound])) / weight
    if slope <= 0.0 or not math.isfinite(slope):
        return [_position_warning(slope, places)]
    ratio = 1.0 / slope
    for named, unit in _NAMED_RATIOS:
        if abs(ratio / named - 1.0) < _RATIO_TOLERANCE:
            raise places.error(
                AbsurdValue,
                f"the integral of the speed is {ratio:.4g} times the change of position, so the "
                f"speed is in {unit}; give its unit in the header or in a mapping",
                "speed_rad_s",
                0,
                ratio,
            )
    return [] if abs(slope - 1.0) < 0.2 else [_position_warning(slope, places)]


def _position_warning(slope: float, places: Places) -> RunWarning:
    return places.warning(
        "position_disagrees",
        f"the change of position is {slope:.4g} times the integral of the speed, expected 1; "
        "check the units, the signs and the gear ratio between the two sensors",
        "position_rad",
    )
