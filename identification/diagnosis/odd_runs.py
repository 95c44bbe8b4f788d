"""Detection of outlying runs: another motor, another load, or a sensor fault in one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.evaluate import Simulated
from identification.warning import ResultWarning

__all__ = ["noise_of_most", "odd_runs", "root_mean_square"]

Array = NDArray[np.float64]

_FAR: Final = 2.0
"""Error of an outlying run over the median error of the other runs, at least."""
_LEAST: Final = 1.5
"""Error of an outlying run over the noise, at least."""


def odd_runs(simulated: Sequence[Simulated], noise: Array) -> list[ResultWarning]:
    """Warnings for runs whose error is far larger than that of the others.

    Args:
        simulated: Training records with their simulation.
        noise: (2,) noise of current and speed [A, rad/s].
    """
    names = list(dict.fromkeys(s.record.name for s in simulated))
    told: dict[str, list[str]] = {}
    for channel, word in enumerate(("current", "speed")):
        ratios = _errors(simulated, channel) / max(float(noise[channel]), 1e-300)
        middles = _middles(ratios)
        for k in np.flatnonzero(ratios > np.maximum(_LEAST, _FAR * middles)):
            how = (
                f"RMS error of the {word} {ratios[k]:.3g} times the sensor noise, median of the "
                f"other runs {middles[k]:.3g}"
            )
            told.setdefault(names[k], []).append(how)
    return [
        ResultWarning(
            "outlying_run",
            "warning",
            f"{name}: outlying run: {'; '.join(found)}",
            "check motor, load and sensors of this run, or omit it from the fit",
        )
        for name, found in told.items()
    ]


def noise_of_most(simulated: Sequence[Simulated], noise: Array) -> Array:
    """(2,) noise of current and speed without the excess error of outlying runs [A, rad/s].

    Args:
        simulated: Training records with their simulation.
        noise: (2,) noise estimated from the residuals of all runs.
    """
    found = noise.copy()
    for channel in range(2):
        errors = _errors(simulated, channel)
        fitting = ~(errors > _FAR * _middles(errors))
        if not fitting.all():
            found[channel] = min(found[channel], float(np.median(errors[fitting])))
    return found


def root_mean_square(simulated: Sequence[Simulated]) -> Array:
    """(2,) RMS error of current and speed over all records [A, rad/s].

    Args:
        simulated: Records with their simulation.
    """
    weight = np.sum([s.record.weight.sum(axis=0) for s in simulated], axis=0)
    square = np.sum([np.sum(s.record.weight * s.residual**2, axis=0) for s in simulated], axis=0)
    return np.asarray(np.sqrt(square / np.maximum(weight, 1.0)))


def _middles(errors: Array) -> Array:
    """(n_run,) median error of the other runs; infinite if there are none."""
    others = [np.delete(errors, k) for k in range(errors.size)]
    return np.array([np.median(each) if each.size else np.inf for each in others])


def _errors(simulated: Sequence[Simulated], channel: int) -> Array:
    """(n_run,) RMS error of each run; zero if nothing was measured."""
    found: dict[str, list[Array]] = {}
    for s in simulated:
        kept = s.record.weight[:, channel] > 0
        found.setdefault(s.record.name, []).append(s.residual[kept, channel])
    errors = [np.concatenate(pieces) for pieces in found.values()]
    return np.array([np.sqrt(np.mean(e**2)) if e.size else 0.0 for e in errors])
