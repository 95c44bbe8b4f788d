"""Single samples far from the simulation: spikes of a sensor, its cable or its converter.

The scale is the median absolute deviation times 1.4826, the standard deviation of normal noise that
outliers do not move (Rousseeuw and Croux, Journal of the American Statistical Association 88
(1993), 1273-1283).  A normal residual leaves ten of them once in 10^23 samples, and where samples
are closer than its time constants a motor takes the neighbours of a sample with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.evaluate import Simulated

__all__ = ["outlier_warnings"]

Array = NDArray[np.float64]

_NORMAL: Final = 1.4826
_FAR: Final = 10.0
_BESIDE: Final = 0.5
"""Largest deviation of a neighbour, over that of the sample."""
_SHARE: Final = 0.5
"""Share of the squared error from which these samples decide what is called noise."""
_CHANNELS: Final = (("current_A", "A"), ("speed_rad_s", "rad/s"))


def outlier_warnings(simulated: Sequence[Simulated]) -> list[str]:
    """Channels of which single samples make more than half of the squared error.

    Args:
        simulated: Training records beside their simulation.
    """
    messages = []
    for channel, (column, unit) in enumerate(_CHANNELS):
        pieces = [
            (s.record.name, s.residual[s.record.weight[:, channel] > 0, channel]) for s in simulated
        ]
        residual = np.concatenate([piece for _, piece in pieces])
        if not residual.size:
            continue
        scale = _NORMAL * float(np.median(np.abs(residual - np.median(residual))))
        alone = np.concatenate([_alone(piece, _FAR * scale) for _, piece in pieces])
        rest = float(np.sum(residual[~alone] ** 2))
        if scale <= 0.0 or rest > (1.0 - _SHARE) * float(np.sum(residual**2)):
            continue
        names = [name for name, piece in pieces if _alone(piece, _FAR * scale).any()]
        farthest = float(np.abs(residual[alone]).max())
        whole = float(np.sqrt(np.mean(residual**2)))
        messages.append(
            f"{', '.join(dict.fromkeys(names))}, column {column}: {int(alone.sum())} single "
            f"samples are more than {_FAR:g} standard deviations from the simulation and from "
            f"their neighbours, the farthest {farthest:.3g} {unit}: spikes of the sensor, its "
            f"cable or its converter; the noise is {scale:.3g} {unit} without and {whole:.3g} "
            f"{unit} with them, and intervals may be too narrow; mend the sensor or remove these "
            "samples"
        )
    return messages


def _alone(residual: Array, far: float) -> NDArray[np.bool_]:
    """Samples farther than a limit whose neighbours are not."""
    size = np.abs(residual)
    padded = np.pad(size, 1)
    beside = np.maximum(padded[:-2], padded[2:])
    return np.asarray((size > far) & (beside < _BESIDE * size))
