"""Limits of a run, their syntax ``voltage=24,current=10,...``, and a limited slew rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.errors import OptionError
from identification.numerals import decimal_of

__all__ = ["UNITS", "Limits", "limits_of", "slew_limited"]

UNITS: Final = {
    "voltage": "V",
    "current": "A",
    "speed": "rad/s",
    "slew": "V/s",
    "position": "rad",
    "load": "N m",
}


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


def slew_limited(voltage: Array, step: float) -> Array:
    """Voltage whose change per sample is at most `step`, from zero and back to zero.

    It lies between zero and `voltage`.
    """
    limited = voltage.copy()
    limited[0] = limited[-1] = 0.0
    if not math.isfinite(step):
        return limited
    # A change of sign passes through zero.
    limited[:-1][limited[:-1] * limited[1:] < 0.0] = 0.0
    # The largest Lipschitz function below each sign's magnitude: min over k of u_k + step |n - k|.
    slope = step * np.arange(limited.size)
    parts = []
    for magnitude in (np.maximum(limited, 0.0), np.maximum(-limited, 0.0)):
        forward = np.minimum.accumulate(magnitude - slope) + slope
        backward = np.minimum.accumulate((magnitude + slope)[::-1])[::-1] - slope
        parts.append(np.maximum(np.minimum(forward, backward), 0.0))
    return np.asarray(parts[0] - parts[1])
