"""Noise of a signal from its differences."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from identification.arrays import Array

__all__ = ["difference_noise"]


def difference_noise(signals: Iterable[Array], order: int) -> float:
    """Noise of a sensor from the median of differences, which ignores steps; 0 if too short."""
    differences = np.abs(np.concatenate([np.diff(signal, order) for signal in signals]))
    gain = 0.6745 * math.sqrt(math.comb(2 * order, order))
    return float(np.median(differences)) / gain if differences.size else 0.0
