"""Sensor noise and quantisation.

Noise levels are relative to rated values, so one setting suits motors of any size.  White noise,
autocorrelated noise (first order), noise with outliers and heavy-tailed noise have the same
standard deviation and differ only in character.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "NOISELESS",
    "Noise",
    "NoiseKind",
    "decimals_for",
    "draw_noise",
    "quantise",
    "round_step",
]

Array = NDArray[np.float64]
NoiseKind = Literal["white", "coloured", "spiky", "heavy"]
_COLOUR = 0.9
_SPIKE_SHARE = 0.005
_SPIKE_SIZE = 10.0
_FREEDOM = 4.0


@dataclass(frozen=True)
class Noise:
    """Noise of the sensors of the bench.

    Args:
        current: Standard deviation relative to rated current [-].
        speed: Standard deviation relative to rated speed [-].
        voltage: Standard deviation relative to rated voltage [-].
        temperature: Standard deviation [K].
        position: Standard deviation [rad].
        kind: Noise type of current and speed.
        step: Resolution of the converters relative to the standard deviation [-].
        temperature_step: Resolution of the thermometer [K].
        position_step: Resolution of the angle, 0 for none [rad].
    """

    current: float = 0.005
    speed: float = 0.003
    voltage: float = 2e-5
    temperature: float = 0.1
    position: float = 0.0
    kind: NoiseKind = "white"
    step: float = 0.25
    temperature_step: float = 0.1
    position_step: float = 2.0 * math.pi / 8192


NOISELESS = Noise(0.0, 0.0, 0.0, 0.0, 0.0, "white", 0.0, 0.0, 0.0)
"""Ideal sensors: every logged value is the true one."""


def draw_noise(rows: int, sd: float, kind: str, rng: np.random.Generator) -> Array:
    """Noise of a channel.

    Args:
        rows: Number of samples.
        sd: Standard deviation, the same for every noise type.
        kind: white, coloured (first-order autoregressive), spiky (with outliers) or heavy
            (Student t with four degrees of freedom).
        rng: Random generator.

    Returns:
        (rows,) in the unit of `sd`.
    """
    white = rng.standard_normal(rows)
    if kind == "white" or sd == 0.0:
        return sd * white
    if kind == "coloured":
        noise = np.empty(rows)
        noise[0] = white[0]
        drive = math.sqrt(1.0 - _COLOUR**2)
        for row in range(1, rows):
            noise[row] = _COLOUR * noise[row - 1] + drive * white[row]
        return sd * noise
    if kind == "spiky":
        is_spike = rng.random(rows) < _SPIKE_SHARE
        noise = np.where(is_spike, _SPIKE_SIZE * white, white)
        return sd * noise / math.sqrt(1.0 + _SPIKE_SHARE * (_SPIKE_SIZE**2 - 1.0))
    if kind == "heavy":
        return sd * rng.standard_t(_FREEDOM, rows) * math.sqrt((_FREEDOM - 2.0) / _FREEDOM)
    raise ValueError(f"noise kind '{kind}'; expected white, coloured, spiky or heavy")


def quantise(values: Array, step: float) -> Array:
    """Round to the resolution of a converter; a step of zero leaves the values unchanged."""
    return np.round(values / step) * step if step > 0.0 else values


def round_step(step: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is not above `step`; 0 stays 0.

    A few decimals represent such a resolution exactly, so files stay small.
    """
    if step <= 0.0:
        return 0.0
    decade = 10.0 ** math.floor(math.log10(step))
    best = max(factor for factor in (1.0, 2.0, 5.0) if factor * decade <= step * (1 + 1e-9))
    return float(f"{best * decade:.3g}")


def decimals_for(step: float) -> int:
    """Number of decimals that represents every multiple of a `round_step` exactly.

    Args:
        step: Resolution; 0 selects 12 decimals.
    """
    return 12 if step <= 0.0 else max(0, -math.floor(math.log10(step * (1.0 + 1e-9))))
