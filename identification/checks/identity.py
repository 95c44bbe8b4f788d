"""Detection of reversed and exchanged channels by the signs of the balance coefficients.

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
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from identification.arrays import Array
from identification.checks.balance import Balance, Regression, Signals, balances_of
from identification.checks.correction import exchange, factor
from identification.checks.finding import Finding
from identification.ingest.run import Run

__all__ = ["identity_findings"]

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

Exchange = Callable[[Array, Array, Array], tuple[Array, Array, Array]]


@dataclass(frozen=True)
class _Hypothesis:
    """A possible channel fault; `change` maps voltage, current and speed, in this order."""

    code: str
    channels: tuple[str, ...]
    change: Exchange
    words: str


_HYPOTHESES: Final = (
    _Hypothesis("reversed_channel", ("current_A",), lambda v, i, w: (v, -i, w), ""),
    _Hypothesis("reversed_channel", ("speed_rad_s",), lambda v, i, w: (v, i, -w), ""),
    _Hypothesis("reversed_channel", ("voltage_V",), lambda v, i, w: (-v, i, w), ""),
    _Hypothesis(
        "exchanged_channels", ("voltage_V", "speed_rad_s"), lambda v, i, w: (w, i, v), "speed"
    ),
    _Hypothesis(
        "exchanged_channels", ("voltage_V", "current_A"), lambda v, i, w: (i, v, w), "current"
    ),
    _Hypothesis(
        "exchanged_channels", ("current_A", "speed_rad_s"), lambda v, i, w: (v, w, i), "speed"
    ),
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
        """Whether the mechanical balance holds only with negative inertia and friction."""
        return self.inertia_turned and self.friction_turned and self.mechanical < _HOLDS


def identity_findings(run: Run, signals: Signals) -> list[Finding]:
    """Finding for a wrong sign or a wrong column in a run, if there is one."""
    as_logged = _judged(balances_of(signals))
    if as_logged is None:
        return []
    is_poor = not as_logged.holds and as_logged.mechanical > _MISSED
    if as_logged.turned == 0.0 and as_logged.is_backwards:
        return [_suspicion(run, as_logged)]
    if as_logged.turned == 0.0 and not is_poor:
        return []
    found = [(h, _judged(balances_of(_changed(signals, h)))) for h in _HYPOTHESES]
    possible = [(h, j) for h, j in found if j is not None and j.turned == 0.0]
    if as_logged.turned == 0.0:
        possible = [(h, j) for h, j in possible if j.holds]
    # With a driven shaft, or current and speed in proportion, not every sign holds.
    possible = [
        (h, j)
        for h, j in possible
        if j.holds or (h.code == "reversed_channel" and not j.is_backwards)
    ]
    if not possible:
        return []
    least = min(judged.missed for _, judged in possible)
    best, judged = min(
        (pair for pair in possible if _BETTER * pair[1].missed <= least),
        key=lambda pair: (not pair[1].holds, pair[1].missed),
    )
    if as_logged.turned == 0.0 and judged.missed > _BETTER * as_logged.missed:
        return []
    return [_finding(run, best, as_logged, judged)]


def _finding(run: Run, best: _Hypothesis, before: _Judged, after: _Judged) -> Finding:
    if best.code == "reversed_channel":
        channel = best.channels[0]
        message = (
            "has the wrong sign: a coefficient of the voltage balance v = R i + K w is negative"
        )
        corrections: tuple[str, ...] = (factor(run, channel, -1.0),)
    else:
        first, second = best.channels
        channel = first
        message = (
            f"{first} and {second} are exchanged: the equations of a motor hold only with the two "
            "columns swapped"
        )
        corrections = exchange(run, first, second)
    if before.turned < 0.0:
        statistic, value, limit = "negative term relative to the voltage", before.turned, -_SHARE
    else:
        statistic, value, limit = "unexplained fraction", before.missed, after.missed / _BETTER
    return Finding(
        best.code, "refuse", run.name, channel, message, statistic, value, limit, corrections
    )


def _suspicion(run: Run, judged: _Judged) -> Finding:
    return Finding(
        "reversed_channel",
        "suspect",
        run.name,
        "speed_rad_s",
        "may have the wrong sign: in the torque balance K i = J dw/dt + b w, inertia and friction "
        "are negative",
        "unexplained fraction of the current variance",
        judged.mechanical,
        _HOLDS,
        (factor(run, "speed_rad_s", -1.0),),
    )


def _changed(signals: Signals, hypothesis: _Hypothesis) -> Signals:
    voltage, current, speed = hypothesis.change(signals.voltage, signals.current, signals.speed)
    return replace(signals, voltage=voltage, current=current, speed=speed)


def _judged(balances: Sequence[Balance]) -> _Judged | None:
    """Result that the balances over all window lengths have in common."""
    pairs = [(b.electrical, b.mechanical) for b in balances]
    fits = [(e, m) for e, m in pairs if e is not None and m is not None]
    if not fits:
        return None
    turned = [
        min([0.0] + [float(e.shares[k]) for k in (0, 1, 2) if _is_turned(e, k)]) for e, _ in fits
    ]
    holds = [bool(e.values[0] > 0 and e.values[1] > 0 and m.values[0] > 0) for e, m in fits]
    return _Judged(
        max(turned),
        all(holds),
        min(e.missed + m.missed for e, m in fits),
        min(m.missed for _, m in fits),
        all(m.is_negative(0, _ERRORS, _SHARE) for _, m in fits),
        all(m.is_negative(1, _ERRORS, _SHARE) for _, m in fits),
    )


def _is_turned(electrical: Regression, k: int) -> bool:
    """Whether R, K or L is significantly negative; L only if R is negative as well."""
    is_negative = electrical.is_negative(k, _ERRORS, _SHARE)
    return is_negative and (k != 2 or bool(electrical.values[0] < 0.0))
