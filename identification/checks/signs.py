"""Detection of reversed, exchanged and unsigned channels by the coefficients of the balances.

The coefficients R, K and J of a motor's balances are positive.  Each reversal or exchange of the
three channels makes at least one of them negative or leaves a balance unexplained, and no two
faults have the same signature.  Every hypothesis is therefore tested on both balances.  The
hypothesis with positive coefficients is the correction.

A generator, or a load that drives the motor, changes the mechanical balance only.  The electrical
balance holds whatever turns the shaft.  A run is therefore refused for its electrical signs alone;
the mechanical balance only selects among the hypotheses.

If friction keeps current and speed in proportion, R and K cannot be separated.  L then gives the
sign of the current: a delay makes L alone negative, a reversed sensor R and L together.  The speed
has no electrical sign in this case.  A mechanical balance that holds with negative inertia and
negative friction is then only a suspicion, since a brake controlled by its speed has the same
signs.

A magnitude keeps one sign while the voltage reverses.  It leaves the voltage balance unexplained,
and the balance holds once the sign is restored.  The restored sign is that of the voltage minus the
other term, so that a braked or reversed motor keeps its direction of rotation.  Signs and
regression are computed alternately.  The speed keeps one sign between two standstills; the current
may change its sign at any sample.  Where voltage and current are magnitudes, only their signs
relative to the speed count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import CHANNELS, Balance, Regression, Signals, reverses
from identification.checks.coasting import without_pauses
from identification.checks.finding import Finding, exchange, factor, refusal, signed, suspicion
from identification.ingest.run import Run

__all__ = ["identity_findings", "magnitude_findings"]

_ERRORS: Final = 5.0
"""Standard errors by which a coefficient has to be below zero.  None of 5,040 balances of simulated
runs, with and without effects, has a negative coefficient."""
_SHARE: Final = 0.03
"""Fraction of the voltage that a negative term has to exceed."""
_MISSED: Final = 0.3
_HOLDS: Final = 0.02
"""Unexplained fraction of the current up to which the mechanical balance holds."""
_BETTER: Final = 0.25
"""Largest ratio of unexplained fractions after and before a correction, if no sign is wrong."""
_UNSIGNED_MISSED: Final = 0.03
_UNSIGNED_BETTER: Final = 0.35
"""Largest ratio of the unexplained fractions with and without the restored sign."""
_TURNS: Final = 4
_STANDSTILL: Final = 0.05
_SIGNED_VALUES: Final = {"current_A": "the signed mean and not the RMS value, a magnitude too"}
"""Quantity to log in place of a magnitude, by channel."""

Exchange = Callable[[Array, Array, Array], tuple[Array, Array, Array]]


@dataclass(frozen=True)
class _Hypothesis:
    """A possible channel fault; `change` maps voltage, current and speed, in this order."""

    code: str
    channels: tuple[str, ...]
    change: Exchange


_HYPOTHESES: Final = (
    _Hypothesis("reversed_channel", ("current_A",), lambda v, i, w: (v, -i, w)),
    _Hypothesis("reversed_channel", ("speed_rad_s",), lambda v, i, w: (v, i, -w)),
    _Hypothesis("reversed_channel", ("voltage_V",), lambda v, i, w: (-v, i, w)),
    _Hypothesis("exchanged_channels", ("voltage_V", "speed_rad_s"), lambda v, i, w: (w, i, v)),
    _Hypothesis("exchanged_channels", ("voltage_V", "current_A"), lambda v, i, w: (i, v, w)),
    _Hypothesis("exchanged_channels", ("current_A", "speed_rad_s"), lambda v, i, w: (v, w, i)),
)


@dataclass(frozen=True)
class _Judged:
    """Balances of a run under one hypothesis."""

    turned: float
    """Most negative significant term of the electrical balance, over the voltage; 0 unless there is
    one at every window length."""
    holds: bool
    """True if R, K and J are all positive."""
    missed: float
    """Sum of the unexplained fractions of both balances."""
    mechanical: float
    """Unexplained fraction of the mechanical balance."""
    inertia_turned: bool
    """True if the inertia is significantly negative."""
    friction_turned: bool
    """True if the viscous friction is significantly negative."""

    @property
    def is_backwards(self) -> bool:
        """True if the mechanical balance holds only with negative inertia and friction."""
        return self.inertia_turned and self.friction_turned and self.mechanical < _HOLDS


def identity_findings(run: Run, signals: Signals) -> list[Finding]:
    """Finding for a wrong sign or a wrong column in a run, if there is one."""
    as_logged = _judged(signals.balances)
    if as_logged is None:
        return []
    is_poor = not as_logged.holds and as_logged.mechanical > _MISSED
    if as_logged.turned == 0.0 and as_logged.is_backwards:
        return [_suspicion(run, as_logged)]
    if as_logged.turned == 0.0 and not is_poor:
        return []
    found = [(h, _judged(_changed(signals, h).balances)) for h in _HYPOTHESES]
    # With a driven shaft, or current and speed in proportion, not every sign holds.
    is_turned = as_logged.turned < 0.0
    possible = [
        (h, j)
        for h, j in found
        if j is not None
        and j.turned == 0.0
        and (j.holds or (is_turned and h.code == "reversed_channel" and not j.is_backwards))
    ]
    if not possible:
        return []
    least = min(judged.missed for _, judged in possible)
    best, judged = min(
        (pair for pair in possible if _BETTER * pair[1].missed <= least),
        key=lambda pair: (not pair[1].holds, pair[1].missed),
    )
    if not is_turned and judged.missed > _BETTER * as_logged.missed:
        return []
    return [_finding(run, best, as_logged, judged)]


def _finding(run: Run, best: _Hypothesis, before: _Judged, after: _Judged) -> Finding:
    channel = best.channels[0]
    if best.code == "reversed_channel":
        message = (
            "has the wrong sign: a coefficient of the voltage balance v = R i + K w is negative"
        )
        corrections: tuple[str, ...] = (factor(run, channel, -1.0),)
    else:
        first, second = best.channels
        message = (
            f"{first} and {second} are exchanged: the equations of a motor hold only with the two "
            "columns swapped"
        )
        corrections = exchange(run, first, second)
    if before.turned < 0.0:
        statistic, value, limit = "negative term relative to the voltage", before.turned, -_SHARE
    else:
        statistic, value, limit = "unexplained fraction", before.missed, after.missed / _BETTER
    return refusal(best.code, run, channel, message, (statistic, value, limit), *corrections)


def _suspicion(run: Run, judged: _Judged) -> Finding:
    return suspicion(
        "reversed_channel",
        run,
        "speed_rad_s",
        "may have the wrong sign: in the torque balance K i = J dw/dt + b w, inertia and friction "
        "are negative",
        ("unexplained fraction of the current variance", judged.mechanical, _HOLDS),
        factor(run, "speed_rad_s", -1.0),
    )


def _changed(signals: Signals, hypothesis: _Hypothesis) -> Signals:
    voltage, current, speed = hypothesis.change(signals.voltage, signals.current, signals.speed)
    return replace(signals, voltage=voltage, current=current, speed=speed)


def _judged(balances: Sequence[Balance]) -> _Judged | None:
    """Result that the balances over all window lengths have in common."""
    fits = [(e, m, b.heated) for b in balances if (e := b.electrical) and (m := b.mechanical)]
    if not fits:
        return None
    turned = [
        min([0.0] + [float(e.shares[k]) for k in (0, 1, 2) if _is_turned(e, h, k)])
        for e, _, h in fits
    ]
    holds = [bool(e.values[0] > 0 and e.values[1] > 0 and m.values[0] > 0) for e, m, _ in fits]
    return _Judged(
        max(turned),
        all(holds),
        min(e.missed + m.missed for e, m, _ in fits),
        min(m.missed for _, m, _ in fits),
        all(_is_below(m, 0) for _, m, _ in fits),
        all(_is_below(m, 1) for _, m, _ in fits),
    )


def _is_turned(electrical: Regression, heated: Regression | None, k: int) -> bool:
    """True if a coefficient is negative: R or K in both regressions, L only if R is negative."""
    too = electrical.values[0] < 0.0 if k == 2 else heated is None or _is_below(heated, k)
    return _is_below(electrical, k) and bool(too)


def _is_below(fit: Regression, k: int) -> bool:
    """True if a coefficient is significantly negative, and so is its term."""
    return bool(fit.values[k] < -_ERRORS * fit.errors[k] and fit.shares[k] < -_SHARE)


def magnitude_findings(run: Run, signals: Signals) -> list[Finding]:
    """Findings for channels of a run that hold magnitudes."""
    # A coasting motor has no braking current, which may be taken for one without its sign.
    signals = without_pauses(signals)
    unsigned = [
        column
        for column, name in CHANNELS.items()
        if not reverses(x := getattr(signals, name)) and np.ptp(x) > 0.0 and np.mean(x) > 0.0
    ]
    # Where current and speed are in proportion, R or K may be negative within its error.
    before = _missed(signals, _ERRORS)
    if before <= _UNSIGNED_MISSED:
        return []
    for names, restored in _restored(signals, unsigned):
        # A channel whose restored sign is constant is reversed, which the other runs show.
        if not any(reverses(getattr(restored, CHANNELS[name])) for name in names):
            continue
        # A restored voltage has another variance: compare the same squares.
        scale = float(np.var(restored.voltage) / np.var(signals.voltage))
        after = _missed(restored) * scale
        if after < _UNSIGNED_BETTER * before:
            limit = max(after / _UNSIGNED_BETTER, _UNSIGNED_MISSED)
            others = [name for name in CHANNELS if name not in unsigned]
            reversing = f"it keeps one sign unlike {' and '.join(others)}" if others else ""
            return [
                refusal(
                    "unsigned_channel",
                    run,
                    name,
                    f"contains magnitudes: {reversing or 'no channel is ever negative'}, and the "
                    "voltage balance holds only with the sign restored; a motor cannot be "
                    "identified from magnitudes",
                    ("unexplained fraction of the voltage variance", before, limit),
                    *signed(run, name),
                    remedy=f"log {_SIGNED_VALUES.get(name, 'the signed value')}, or map it times a "
                    f"column of the direction, {name}=HEADER * DIRECTION",
                )
                for name in names
            ]
    return []


def _restored(signals: Signals, unsigned: list[str]) -> Iterator[tuple[list[str], Signals]]:
    """Possible sets of magnitudes, each with the signals whose signs are restored."""
    if not unsigned or not np.ptp(signals.voltage) > 0.0:
        return
    if "voltage_V" not in unsigned:
        choices = [[name] for name in unsigned] + ([unsigned] if len(unsigned) == 2 else [])
        yield from ((names, _signed(signals, names)) for names in choices)
    elif unsigned == ["voltage_V"]:
        yield unsigned, _with_signed_voltage(signals)
    elif "current_A" in unsigned:
        yield unsigned, _relative_to_speed(signals)


def _missed(signals: Signals, errors: float = 0.0) -> float:
    """Least unexplained fraction of the voltage over the window lengths, with positive R and K.

    They may be below zero by a number of standard errors.
    """
    fits = [f for b in signals.balances if (f := b.electrical) is not None]
    least = [-errors * f.errors[:2] if errors else 0.0 for f in fits]
    shares = [f.missed for f, low in zip(fits, least, strict=True) if np.all(f.values[:2] > low)]
    return min(shares, default=1.0)


def _signed(signals: Signals, names: list[str]) -> Signals:
    """Signals with signs restored from the voltage balance."""
    sign = np.where(signals.voltage < 0.0, -1.0, 1.0)
    current = sign * signals.current if "current_A" in names else signals.current
    speed = signals.speed
    if "speed_rad_s" in names:
        speed = _by_region(signals.speed, sign)
    for _ in range(_TURNS):
        found = _coefficients(replace(signals, current=current, speed=speed))
        if found is None:
            break
        resistance, constant = found
        if "current_A" in names:
            left = signals.voltage - constant * speed
            current = np.where(left < 0.0, -1.0, 1.0) * signals.current
        if "speed_rad_s" in names:
            speed = _by_region(signals.speed, signals.voltage - resistance * current)
    return replace(signals, current=current, speed=speed)


def _with_signed_voltage(signals: Signals) -> Signals:
    """Signals with the sign of the voltage restored from current and speed."""
    sign = np.where(signals.current < 0.0, -1.0, 1.0)
    for _ in range(_TURNS):
        found = _coefficients(replace(signals, voltage=sign * signals.voltage))
        if found is None:
            break
        drive = found[0] * signals.current + found[1] * signals.speed
        sign = np.where(drive < 0.0, -1.0, 1.0)
    return replace(signals, voltage=sign * signals.voltage)


def _relative_to_speed(signals: Signals) -> Signals:
    """Signals with voltage and current signed relative to the speed, which becomes positive.

    A motor that drives or generates has abs(R i) = abs(v - K w) with a positive v; one that is
    braked by a reversed voltage has R i = v + K w in magnitudes.
    """
    volts, amperes, speed = map(np.abs, (signals.voltage, signals.current, signals.speed))
    voltage, current = volts, amperes
    for _ in range(_TURNS):
        now = replace(signals, voltage=voltage, current=current, speed=speed)
        found = _coefficients(now)
        if found is None:
            break
        drop, induced = found[0] * amperes, found[1] * speed
        is_braked = np.abs(drop - volts - induced) < np.abs(drop - np.abs(volts - induced))
        voltage = np.where(is_braked, -volts, volts)
        current = np.where(voltage < induced, -amperes, amperes)
    return replace(signals, voltage=voltage, current=current, speed=speed)


def _coefficients(signals: Signals) -> tuple[float, float] | None:
    """R and K of the voltage balance over the longest windows, not below zero; None if unknown."""
    balances = signals.balances
    fit = balances[-1].electrical if balances else None
    return None if fit is None else (max(float(fit.values[0]), 0.0), max(float(fit.values[1]), 0.0))


def _by_region(speed: Array, drive: Array) -> Array:
    """Speed with one sign between two standstills, that of the mean drive there."""
    moving = np.abs(speed) > _STANDSTILL * float(np.abs(speed).max())
    edges = np.flatnonzero(np.diff(moving.astype(np.int8))) + 1
    starts = np.concatenate(([0], edges))
    total = np.add.reduceat(drive, starts)
    sign = np.where(total < 0.0, -1.0, 1.0)
    return np.asarray(speed * np.repeat(sign, np.diff(np.append(starts, speed.size))))
