"""Student-t weights of outliers in the Kalman filter.

An outlier is not missing physics, but a filter for normal noise would explain it by a short burst
of voltage.  Samples far from their prediction by all others are weighted under a Student-t law and
never deleted.  This is done only if that law is clearly better than the normal one.

Source: Lange, Little, Taylor, J. American Statistical Association 84 (1989) 881-896.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.deviation import Deviation, Piece
from identification.diagnosis.filtering import Likelihood
from identification.diagnosis.smoothing import surprises
from identification.fit.noise import student

__all__ = ["weighted"]

Array = NDArray[np.float64]


def weighted(
    deviation: Deviation, pieces: Sequence[Piece], hyper: Array, known: Likelihood
) -> list[Piece] | None:
    """The pieces with outliers down-weighted; None if the noise is normal.

    Args:
        deviation: The linear model.
        pieces: Segments of its records.
        hyper: (n_hyper, 1) hyperparameters, see `HYPER`.
        known: Posterior of the parameters under them.
    """
    found = surprises(deviation, pieces, hyper, known)
    laws = _laws(pieces, found)
    if all(law is None for law in laws):
        return None
    changed = []
    for piece, surprise in zip(pieces, found, strict=True):
        weight = piece.weight.copy()
        for channel, law in enumerate(laws):
            if law is not None:
                freedom, scale = law
                ratio = surprise[:, channel] / scale
                weight[:, channel] *= (freedom + 1) / (freedom + ratio**2)
        changed.append(replace(piece, weight=weight))
    return changed


def _laws(pieces: Sequence[Piece], found: Sequence[Array]) -> list[tuple[float, float] | None]:
    """For each channel degrees of freedom and scale of the Student-t law; None if it is normal."""
    laws: list[tuple[float, float] | None] = []
    for channel in range(2):
        kept = [
            surprise[:, channel][piece.weight[:, channel] > 0]
            for piece, surprise in zip(pieces, found, strict=True)
        ]
        stacked = np.concatenate(kept)
        freedom, scale = student(stacked) if stacked.size else (None, 0.0)
        laws.append(None if freedom is None else (freedom, scale))
    return laws
