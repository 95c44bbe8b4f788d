"""Detection of a current that was logged in the supply lead of a chopper.

A chopper with the duty cycle d = v / V draws the mean current i_s = d i from a supply of voltage V.
The balances of the motor then hold for i_s only with both sides multiplied by v,

    v^2 = R V i_s + K v w + u |v|                               electrical power
    i_s = (J v dw/dt + b v w + c |v| + m v) / (K V)             mechanical power

The logged current is that of the supply if both balances hold better with i_s than with the current
of the motor, v i in place of V i_s.  A load that drives the shaft leaves the first one unchanged,
and a locked rotor the second.  The motor current cannot be restored: i = i_s V / v is noise where
the voltage passes zero.

Source: Erickson and Maksimovic, Fundamentals of Power Electronics (2001), chapter 3 (dc transformer
model of a converter).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import Regression, Signals, regress, reverses, windows_of
from identification.checks.discontinuous import is_discontinuous
from identification.checks.finding import Finding, refusal
from identification.ingest.run import Run

__all__ = ["supply_current_findings"]

_MISSED: Final = 0.03
_BETTER: Final = 0.35
"""Least unexplained fraction of the current as logged, and largest ratio of the fractions with the
current of a supply and of a motor; both are those of a restored sign in `checks.signs`."""


def supply_current_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Finding for a current that obeys the power balances and not those of a motor."""
    as_motor = [balance.mechanical for balance in signals.balances]
    before = min((fit.missed for fit in as_motor if fit is not None), default=0.0)
    if before < _MISSED:
        return
    after = _least(_mechanical(signals), (0,))
    of_supply = _least(_electrical(signals, signals.current), (0, 1))
    of_motor = _least(_electrical(signals, signals.voltage * signals.current), ())
    # A discontinuous current obeys neither voltage balance; the torque balance remains.
    if after < _BETTER * before and (of_supply < _BETTER * of_motor or is_discontinuous(signals)):
        statistic = "unexplained fraction of the current variance by the torque balance"
        yield refusal(
            "supply_current",
            run,
            "current_A",
            "is the current of the supply, i v / V, and not that of the motor: it obeys the power "
            "balances of a chopper and not the balances of a motor; log the current in the motor "
            "lead, a motor cannot be identified from the supply current",
            (statistic, before, max(after / _BETTER, _MISSED)),
        )


def _least(fits: list[Regression | None], positive: tuple[int, ...]) -> float:
    """Least unexplained fraction of the fits in which these coefficients are positive, or 1."""
    return min(
        (f.missed for f in fits if f is not None and all(f.values[k] > 0.0 for k in positive)),
        default=1.0,
    )


def _electrical(signals: Signals, drawn: Array) -> list[Regression | None]:
    """Regressions of v^2 on the current drawn, v w and |v|."""
    v, w = signals.voltage, signals.speed
    return [
        regress(of.mean(v**2), [of.mean(drawn), of.mean(v * w), of.mean(np.abs(v))])
        for of in windows_of(signals)
    ]


def _mechanical(signals: Signals) -> list[Regression | None]:
    """Regressions of the current on v dw/dt, v w, |v| and, if the voltage reverses, v."""
    v, w, fits = signals.voltage, signals.speed, []
    for of in windows_of(signals):
        regressors = [of.mean(v) * of.rate(w), of.mean(v * w), of.mean(np.abs(v))]
        if reverses(v):
            regressors.append(of.mean(v))
        fits.append(regress(of.mean(signals.current), regressors))
    return fits
