"""Detection of a chopper whose current is zero during a part of each period.

A chopper with a diode draws no current backwards.  If the current reaches zero before the next
pulse, the diode blocks, and until then the voltage at the motor is its back-EMF.  The mean voltage
at the motor is thus above the logged one, which is the duty cycle times that of the supply.  With
the logged voltage, the motor seems to turn without negative current although

    v < K w        with   v = R i + K w + v0   where the current is large

which no motor does.

Source: Erickson and Maksimovic, Fundamentals of Power Electronics (2001), chapter 5 (discontinuous
conduction mode).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import NO_VOLTAGE, Signals, regress, windows_of
from identification.checks.finding import Finding, refusal
from identification.ingest.run import Run

__all__ = ["discontinuous_findings", "is_discontinuous"]

_LARGE: Final = (0.3, 0.2, 0.1)
"""Least current, over the largest, of the windows in which it is continuous; the first with enough
windows is used."""
_FEWEST: Final = 20
"""Fewest windows with a large current, and with a small one."""
_BACKWARDS: Final = 0.05
"""Largest negative current over the largest positive one, both without the extreme 1 %."""
_TURNS: Final = 0.1
"""Least speed over the largest speed."""
_UNEXPLAINED: Final = 0.1
"""Least unexplained fraction of the voltage variance; a judgement without a derivation."""
_BELOW: Final = -0.2
"""Mean voltage above R i + K w at small currents, over the RMS voltage, of such a chopper.  A
judgement without a derivation: an RMS current in place of the mean one gives a smaller one."""


def discontinuous_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Finding for a voltage below the back-EMF in a run without negative current."""
    excess = _voltage_excess(signals)
    if excess < _BELOW:
        yield refusal(
            "discontinuous_current",
            run,
            "voltage_V",
            "is below the back-EMF while the motor turns without braking current: the current of "
            "the chopper is discontinuous, and the logged voltage is not that at the terminals "
            "while the current is zero; raise the PWM frequency, let the bridge brake (slow decay, "
            "synchronous rectification), or log the mean voltage at the motor terminals; if the "
            "current was logged in the supply lead, log that of the motor",
            ("mean voltage above R i + K w at small currents over the RMS voltage", excess, _BELOW),
        )


def is_discontinuous(signals: Signals) -> bool:
    """True if the voltage is below the back-EMF in a run without negative current."""
    return _voltage_excess(signals) < _BELOW


def _voltage_excess(signals: Signals) -> float:
    """Mean voltage above R i + K w at small currents over the RMS voltage; 0 if it means nothing.

    It means something if the current hardly reverses, and neither one R and K nor a K that changes
    with the current, as that of a saturated or series motor, explain the voltage.
    """
    direction = np.sign(signals.voltage)
    low, high = np.quantile(direction * signals.current, [0.01, 0.99])
    if not -low < _BACKWARDS * high:
        return 0.0
    windows = next(iter(windows_of(signals)), None)
    if windows is None:
        return 0.0
    voltage, current, speed = (
        windows.mean(direction * each) for each in (signals.voltage, signals.current, signals.speed)
    )
    regressors = (current, speed, windows.rate(direction * signals.current))
    whole = regress(voltage, [*regressors, current * speed])
    if whole is None or not whole.missed > _UNEXPLAINED:
        return 0.0
    return _excess(voltage, regressors, high)


def _excess(voltage: Array, regressors: tuple[Array, Array, Array], high: float) -> float:
    """Mean voltage above R i + K w at small currents over the RMS voltage; 0 without an R and K.

    The voltage (n_window,) and the regressors, which are current, speed and current rate, have the
    sign of the voltage; `high` is the largest current.
    """
    current, speed, _ = regressors
    turns = (speed > _TURNS * speed.max()) & (voltage > NO_VOLTAGE * voltage.max())
    for share in _LARGE:
        large = current > share * high
        small = turns & ~large
        if min(np.count_nonzero(large), np.count_nonzero(small)) < _FEWEST:
            continue
        fit = regress(voltage[large], [each[large] for each in regressors])
        if fit is not None and min(fit.values[:2]) > 0.0:
            above = voltage - fit.values[0] * current - fit.values[1] * speed
            mean = float(np.mean(above[small]) - np.mean(above[large]))
            return mean / float(np.sqrt(np.mean(voltage**2)))
    return 0.0
