"""Simulation errors of a model on the validation runs.

Amplitudes that are free in each record are fitted to the first half of each validation record and
predict the second one.  Fitted to all of it, a Fourier series would follow any slow torque, such as
that of a hand on the shaft, and nothing would be predicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.evaluate import simulate_most_alike
from identification.fit.solve import Fit
from identification.model.composite import Edges
from identification.model.excitation import Record

__all__ = ["ValidationErrors", "validation_errors"]

_FITTED: Final = 0.5
"""Fraction of a validation record to which per-record amplitudes are fitted."""


@dataclass(frozen=True)
class ValidationErrors:
    """Simulation errors of a model on the validation runs, whitened if its noise is."""

    square: Array
    """(2,) mean square error, infinite if the simulation diverges [A^2, rad^2/s^2]."""
    count: Array
    """(2,) number of samples."""
    scatter: Array
    """(2,) standard error of the logarithm of the RMS error, from its kurtosis [-]."""
    compared: tuple[tuple[Record, Array], ...] = ()
    """Each record with its residual (n_sample, 2), whitened as the fit [A, rad/s]."""

    @classmethod
    def of(cls, compared: Sequence[tuple[Record, Array]], fraction: float) -> ValidationErrors:
        """Errors from the residual of each record, at an effective sample fraction [-]."""
        total, fourth, count = np.zeros(2), np.zeros(2), np.zeros(2)
        for record, residual in compared:
            total += np.sum(record.weight * residual**2, axis=0)
            fourth += np.sum(record.weight * residual**4, axis=0)
            count += record.weight.sum(axis=0)
        many = np.maximum(count, 1.0)
        square = np.nan_to_num(total / many, nan=np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            uneven = np.maximum(np.nan_to_num(fourth / many / square**2 - 1.0), 0.0)
        scatter = 0.5 * np.sqrt(uneven / (many * fraction))
        return cls(square, count, scatter, tuple(compared))

    def within(self, edges: Edges, fraction: float) -> ValidationErrors:
        """The errors without the edge samples of every record; see `Record.within`."""
        if not self.compared:
            return self
        inner = [(record.within(edges), residual) for record, residual in self.compared]
        return ValidationErrors.of(inner, fraction)

    def expected_log_odds(self, simpler: ValidationErrors, deviation: Array) -> float:
        """Log odds against a simpler model that the runs reach in the mean if this one is true.

        Half the sum of squares of the difference between the two predictions, in standard
        deviations of the noise (2,) [A, rad/s]; infinite if it cannot be computed [-].
        """
        total = 0.0 if self.compared else np.inf
        for (record, own), (_, other) in zip(self.compared, simpler.compared, strict=True):
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                total += 0.5 * float(np.sum(record.weight * ((own - other) / deviation) ** 2))
        return total if np.isfinite(total) else np.inf


def validation_errors(fit: Fit, records: Sequence[Record], fraction: float) -> ValidationErrors:
    """Simulate validation records with a fit; the effective sample fraction is its own [-]."""
    own = any(state.is_own for term in fit.simulator.model.terms for state in term.states)
    simulated = simulate_most_alike(fit, records, whole=own, most=_FITTED)
    whitened = [(s.record, fit.weighting.both_whitened(s.residual)) for s in simulated]
    return ValidationErrors.of(whitened, fraction)
