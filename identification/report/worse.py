"""Warnings on validation runs that the effects predict worse than the nominal model does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.evaluate import Simulated

__all__ = ["worse_warnings"]

_CODE: Final = "effects_predict_worse"
_WORSE: Final = 1.05
"""Error ratio above which an increase is reported; both models see the same noise, so it is not
scatter."""
_CHANNELS: Final = ("current", "speed")


def worse_warnings(
    before: Sequence[Simulated],
    after: Sequence[Simulated],
    noise: NDArray[np.float64],
    effects: Sequence[str],
) -> list[str]:
    """One warning for each run and channel whose error increases with the effects.

    Args:
        before: Validation records simulated by the nominal model.
        after: The same records simulated by the final model.
        noise: (2,) standard deviation of the noise of current and speed [A, rad/s].
        effects: Names of the effects of the final model.
    """
    found = []
    for run in dict.fromkeys(one.record.name for one in after):
        nominal = _errors([one for one in before if one.record.name == run])
        final = _errors([one for one in after if one.record.name == run])
        for channel, name in enumerate(_CHANNELS):
            if final[channel] > _WORSE * max(nominal[channel], noise[channel]):
                found.append(
                    f"{_CODE}: {run}: with {', '.join(effects)} the RMSE of the {name} is "
                    f"{final[channel] / noise[channel]:.3g} times the sensor noise, with the "
                    f"nominal model {nominal[channel] / noise[channel]:.3g} times; predict this "
                    "run with --declared, or add it to the training runs, so that the search can "
                    "find the missing effect"
                )
    return found


def _errors(simulated: Sequence[Simulated]) -> NDArray[np.float64]:
    """(2,) RMS error of current and speed [A, rad/s]; zero if all samples have zero weight."""
    squares = np.sum([np.sum(s.record.weight * s.residual**2, axis=0) for s in simulated], axis=0)
    counts = np.sum([np.sum(s.record.weight, axis=0) for s in simulated], axis=0)
    return np.asarray(np.sqrt(squares / np.maximum(counts, 1.0)))
