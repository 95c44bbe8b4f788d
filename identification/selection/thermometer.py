"""Consider covariance of a logged temperature in coarse steps.

A log without noise to dither its steps leaves the temperature unknown within half a step, over as
long as a step lasts.  The smoothed temperature of each record therefore has an unknown error

    e(x) = sum_k a_k P_k(x),     a_k ~ N(0, s^2),     -1 <= x <= 1 over the record,

with Legendre polynomials up to order 5 and s such that e has the variance of rounding, step^2 / 12,
on average over the record.  This is an upper bound: the instants of the steps limit e further.
More samples do not average this error.  The change of all parameters with each a_k, to first order,
joins the intervals.  A term that lags the log also feels the derivative of e, and so that of a log
with noise, whose smoothing has an error too.  A model whose terms estimate the error needs no such
change.

Source: Widrow, Kollar and Liu, IEEE Trans. Instrumentation and Measurement 45 (1996), 353-361
(rounding error); Schmidt, in Advances in Control Systems 3 (1966), 293-340 (consider covariance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.polynomial import legendre

from identification.arrays import Array
from identification.fit.solve import Fit
from identification.model.excitation import Record
from identification.model.term import AbstractTemperature
from identification.selection.omitted import OmittedTerm, input_errors

__all__ = ["thermometer_errors"]

_ORDERS: Final = 6
"""Legendre polynomials of a record's error."""


def thermometer_errors(fit: Fit, fraction: float) -> tuple[OmittedTerm, ...]:
    """Parameter changes by the unknown error of temperature logs in steps, or of those that lag."""
    terms = [t for t in fit.simulator.model.terms if isinstance(t, AbstractTemperature)]
    least = max((term.log_step for term in terms), default=0.0)
    steps = [max(record.resolution, least) for record in fit.simulator.records]
    if not any(steps) or any(state.is_own for term in terms for state in term.states):
        return ()
    return input_errors(fit, fraction, "temperature_resolution", _deviations(fit, steps))


def _deviations(fit: Fit, steps: Sequence[float]) -> list[Array]:
    """For each record (n_sample, 2, n_order) change of the simulated channels by each error.

    `steps` are those of the logs [K].
    """
    known = fit.simulated()
    values = fit.values[:, None]
    changed = []
    for order in range(_ORDERS):
        pairs = zip(fit.simulator.records, steps, strict=True)
        records = tuple(_with_error(record, step, order) for record, step in pairs)
        logged = replace(fit.simulator, records=records).logged(values, fit.states)
        changed.append([y[:, :, 0] - k for y, k in zip(logged, known, strict=True)])
    return [np.stack(own, axis=2) for own in zip(*changed, strict=True)]


def _with_error(record: Record, step: float, order: int) -> Record:
    """The record with one standard deviation of one error in its temperature."""
    span = max(float(record.time[-1] - record.time[0]), 1e-300)
    where = 2.0 * (record.time - record.time[0]) / span - 1.0
    shares = 1.0 / (2.0 * np.arange(_ORDERS) + 1.0)
    series = np.eye(_ORDERS)[order] * step / np.sqrt(12.0 * shares.sum())
    error = legendre.legval(where, series)
    changes = {
        "temperature": error,
        "temperature_next": np.append(error[1:], error[-1]),
        "temperature_rate": legendre.legval(where, legendre.legder(series)) * 2.0 / span,
    }
    return record.with_inputs({k: record.column(k) + change for k, change in changes.items()})
