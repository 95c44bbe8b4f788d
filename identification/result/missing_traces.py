"""Plot data of the missing voltage or torque over time, in the run where it is strongest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.model.term import AbstractTerm
from identification.result.missing_terms import UNITS, WORDS, acts_in_motor, column_of
from identification.result.partial_residuals import FinalPath, PathSamples
from identification.result.report_data import MissingTrace

__all__ = ["missing_traces"]

Array = NDArray[np.float64]

_Q95: Final = 1.6449
_POINTS: Final = 1200
_SWINGS: Final = 24.0
_LEAST_DRAWN: Final = 100


def missing_traces(path: FinalPath, found: PathSamples, names: Sequence[str]) -> list[MissingTrace]:
    """Plot data for each equation with an effect: a section of the run where it is strongest.

    Args:
        path: Simulation of the final model over the records.
        found: The same at samples spread over all records.
        names: File name of each record.
    """
    plots = []
    for column in range(2):
        acting = [
            term
            for term in path.final.simulator.model.terms
            if acts_in_motor(term) and column == column_of(term, found)
        ]
        if acting:
            plots.append(_over_time(acting, column, path, found, names))
    return plots


def _over_time(
    terms: Sequence[AbstractTerm],
    column: int,
    path: FinalPath,
    found: PathSamples,
    names: Sequence[str],
) -> MissingTrace:
    """Estimated and fitted sum of these effects over time, in the record where it is strongest."""
    everywhere = _together(terms, column, found)[0]
    records = np.unique(found.record)
    power = [float(np.mean(everywhere[found.record == k] ** 2)) for k in records]
    chosen = int(records[int(np.argmax(power))])
    size = path.final.simulator.records[chosen].rows - 1
    whole = path.within(chosen, np.unique(np.linspace(0, size - 1, _POINTS).astype(int)))
    here = path.within(chosen, _telling(_together(terms, column, whole)[0], size))
    effects = _together(terms, column, here)
    missing = here.missing[:, column]
    sd = _Q95 * here.missing_sd[:, column]
    return MissingTrace(
        run=names[chosen],
        quantity=WORDS[column],
        unit=UNITS[column],
        time=here.time,
        median=missing,
        q05=missing - sd,
        q95=missing + sd,
        fitted=np.median(effects, axis=0),
        effect=" and ".join(term.name for term in terms),
    )


def _together(terms: Sequence[AbstractTerm], column: int, found: PathSamples) -> Array:
    """(n_draw, n_sample) sum of effects."""
    return np.asarray(np.sum([found.effects[term.name][:, :, column] for term in terms], axis=0))


def _telling(effect: Array, size: int) -> NDArray[np.int_]:
    """Sample indices to plot: the whole record, or a section that resolves single oscillations.

    Args:
        effect: (n_point,) the effect at points spread over the record.
        size: Number of samples of the record.
    """
    swings = float(np.abs(np.diff(effect)).sum()) / (float(np.ptp(effect)) or 1.0)
    length = int(size * min(1.0, _SWINGS / max(swings, 1e-9)))
    length = max(length, min(size, _LEAST_DRAWN))
    begin = (size - length) // 3
    return np.unique(np.linspace(begin, begin + length - 1, min(length, _POINTS)).astype(int))
