"""Substeps of unequal length."""

from __future__ import annotations

import numpy as np

from identification.model.substeps import Substeps

__all__ = ["unequal"]


def unequal(samples: int, seed: int) -> Substeps:
    """Random substeps of as many sample intervals, of unequal number and length."""
    rng = np.random.default_rng(seed)
    substeps = Substeps.even(rng.integers(1, 4, samples))
    return substeps.halved(rng.integers(0, 3, substeps.rows))
