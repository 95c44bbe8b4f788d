"""Channels with the wrong sign, and channels that stand in each other's column.

The balances of a motor have positive coefficients R, K and J.  Each way in which three channels
can be turned or exchanged breaks at least one of these signs or leaves a balance unexplained, and
no two ways break them alike.  So every hypothesis is put to both balances, and the one under which
the run is a motor is the correction.

A generator and a load that drives the motor change the mechanical balance only; the electrical one
holds whatever turns the shaft.  So a run is refused on the electrical signs alone; the mechanical
balance serves for the choice among the hypotheses.

Where friction keeps current and speed in proportion, neither R nor K is known, and L tells the sign
of the current: a delay makes L alone negative, a reversed sensor R and L together.  There the speed
has no electrical sign at all.  A mechanical balance that holds with a negative inertia and a
negative friction is then a suspicion, since a brake that is controlled by its speed has one, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from identification.checks.balance import Array, Balance, Regression, Signals, balances_of
from identification.checks.correction import exchange, factor
from identification.checks.finding import Finding
from identification.ingest.run import Run

__all__ = ["identity_findings", "is_contradictory"]

_ERRORS: Final = 5.0
"""Standard errors by which a coefficient has to be below zero.  5,040 balances of simulated runs
with and without effects have no negative one at all."""
_SHARE: Final = 0.03
"""Share of the voltage that a negative term has to carry."""
_MISSED: Final = 0.3
_HOLDS: Final = 0.02
"""Unexplained share of the current up to which the mechanical balance is taken to hold."""
_BETTER: Final = 0.25
"""Share of the unexplained part that an exchange may leave, where no sign speaks."""

Exchange = Callable[[Array, Array, Array], tuple[Array, Array, Array]]


@dataclass(frozen=True)
class _Hypothesis:
    """One way in which the channels may be wrong; voltage, current, speed in this order."""

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
    """Signals of a run under one hypothesis.

    Args:
        turned: Least term of the electrical balance that is negative beyond doubt, as a share of
            the voltage; 0 where none is.
        holds: Whether R, K and J are all positive.
        missed: What both balances leave unexplained, together.
        mechanical: What the mechanical one leaves.
        inertia_turned: Whether the inertia is negative beyond doubt.
        friction_turned: Whether the viscous friction is.
    """

    turned: float
    holds: bool
    missed: float
    mechanical: float
    inertia_turned: bool
    friction_turned: bool

    @property
    def is_backwards(self) -> bool:
        """Whether the mechanical balance holds, and only with negative inertia and friction."""
        return self.inertia_turned and self.friction_turned and self.mechanical < _HOLDS


def identity_findings(run: Run, signals: Signals) -> list[Finding]:
    """The contradiction of signs or columns in a run, if there is one.

    Args:
        run: The run.
        signals: Its signals.
    """
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
    # Where the shaft is driven, or current and speed are in proportion, a sign need not hold.
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


def is_contradictory(signals: Signals) -> bool:
    """Whether the electrical balance has a coefficient that is negative beyond doubt."""
    judged = _judged(balances_of(signals))
    return judged is not None and judged.turned < 0.0


def _finding(run: Run, best: _Hypothesis, before: _Judged, after: _Judged) -> Finding:
    if best.code == "reversed_channel":
        channel = best.channels[0]
        message = (
            "has the opposite sign of what the voltage balance v = R i + K w of a motor asks for"
        )
        corrections: tuple[str, ...] = (factor(run, channel, -1.0),)
    else:
        first, second = best.channels
        channel = first
        message = f"{first} and {second} stand in each other's column: only exchanged is it a motor"
        corrections = exchange(run, first, second)
    if before.turned < 0.0:
        statistic, value, limit = "share of the voltage", before.turned, -_SHARE
    else:
        statistic, value, limit = "unexplained", before.missed, after.missed / _BETTER
    return Finding(
        best.code, "refuse", run.name, channel, message, statistic, value, limit, corrections
    )


def _suspicion(run: Run, judged: _Judged) -> Finding:
    return Finding(
        "reversed_channel",
        "suspect",
        run.name,
        "speed_rad_s",
        "has the opposite sign of what the torque balance K i = J dw/dt + b w of a motor asks for, "
        "in which inertia and friction are negative",
        "unexplained share of the current",
        judged.mechanical,
        _HOLDS,
        (factor(run, "speed_rad_s", -1.0),),
    )


def _changed(signals: Signals, hypothesis: _Hypothesis) -> Signals:
    voltage, current, speed = hypothesis.change(signals.voltage, signals.current, signals.speed)
    return replace(signals, voltage=voltage, current=current, speed=speed)


def _judged(balances: Sequence[Balance]) -> _Judged | None:
    """The verdict that the balances over all lengths of windows share."""
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
    """Whether R, K or L is negative beyond doubt; L only where R is negative, too."""
    is_negative = electrical.is_negative(k, _ERRORS, _SHARE)
    return is_negative and (k != 2 or bool(electrical.values[0] < 0.0))
