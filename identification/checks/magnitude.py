"""Detection of channels that were logged as magnitudes, without their sign.

A magnitude keeps one sign while the voltage reverses.  It leaves the voltage balance unexplained,
and the balance holds once the sign is restored.  The restored sign is that of the voltage minus the
other term, so that a braked or reversed motor keeps its direction of rotation.  Signs and
regression are computed alternately.  The speed keeps one sign between two standstills; the current
may change its sign at any sample.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import Balance, Signals, balances_of, reverses
from identification.checks.finding import Finding
from identification.ingest.run import Run

__all__ = ["magnitude_findings"]

_MISSED: Final = 0.03
_BETTER: Final = 0.35
"""Largest ratio of the unexplained fractions with and without the restored sign."""
_TURNS: Final = 4
_STANDSTILL: Final = 0.05


def magnitude_findings(run: Run, signals: Signals) -> list[Finding]:
    """Findings for channels of a run that hold magnitudes."""
    if not reverses(signals.voltage):
        return []
    unsigned = [
        name
        for name, signal in (("current_A", signals.current), ("speed_rad_s", signals.speed))
        if not reverses(signal) and np.ptp(signal) > 0.0
    ]
    if not unsigned:
        return []
    before = _missed(signals)
    choices = [[name] for name in unsigned] + ([unsigned] if len(unsigned) == 2 else [])
    for names in choices:
        after = _missed(_signed(signals, names))
        if before > _MISSED and after < _BETTER * before:
            return [_finding(run, name, before, after) for name in names]
    return []


def _finding(run: Run, name: str, before: float, after: float) -> Finding:
    return Finding(
        "unsigned_channel",
        "refuse",
        run.name,
        name,
        "contains magnitudes: it keeps one sign while the voltage reverses, and the voltage "
        "balance holds only with the sign restored; log the signed value, a motor cannot be "
        "identified from magnitudes",
        "unexplained fraction of the voltage variance",
        before,
        max(after / _BETTER, _MISSED),
    )


def _missed(signals: Signals) -> float:
    """Least unexplained fraction of the voltage over the window lengths, with positive R and K."""
    fits = [b.electrical for b in balances_of(signals)]
    shares = [f.missed for f in fits if f is not None and f.values[0] > 0 and f.values[1] > 0]
    return min(shares, default=1.0)


def _signed(signals: Signals, names: list[str]) -> Signals:
    """Signals with signs restored from the voltage balance."""
    sign = np.where(signals.voltage < 0.0, -1.0, 1.0)
    current = sign * signals.current if "current_A" in names else signals.current
    speed = signals.speed
    if "speed_rad_s" in names:
        speed = _by_region(signals.speed, sign)
    for _ in range(_TURNS):
        balances: list[Balance] = balances_of(replace(signals, current=current, speed=speed))
        fit = balances[-1].electrical if balances else None
        if fit is None:
            break
        resistance, constant = max(float(fit.values[0]), 0.0), max(float(fit.values[1]), 0.0)
        if "current_A" in names:
            left = signals.voltage - constant * speed
            current = np.where(left < 0.0, -1.0, 1.0) * signals.current
        if "speed_rad_s" in names:
            speed = _by_region(signals.speed, signals.voltage - resistance * current)
    return replace(signals, current=current, speed=speed)


def _by_region(speed: Array, drive: Array) -> Array:
    """Speed with one sign between two standstills, that of the mean drive there."""
    moving = np.abs(speed) > _STANDSTILL * float(np.abs(speed).max())
    edges = np.flatnonzero(np.diff(moving.astype(np.int8))) + 1
    starts = np.concatenate(([0], edges))
    total = np.add.reduceat(drive, starts)
    sign = np.where(total < 0.0, -1.0, 1.0)
    return np.asarray(speed * np.repeat(sign, np.diff(np.append(starts, speed.size))))
