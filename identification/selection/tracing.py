"""Missing torque and voltage as spline curves over single signals.

A smooth curve in one signal is added to one of the two balances, and its spline coefficients are
scored like a prototype.  Everything that the fitted parameters and initial states can reproduce is
projected out, so that the gain belongs to a dependence that the model does not have yet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.effects.orders import largest_peaks
from identification.fit.solve import Fit
from identification.model.excitation import sample_interval
from identification.selection.candidates import scales_of
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.score import Score, gathered
from identification.selection.screen import screened
from identification.surrogates.coefficient import CoefficientChange
from identification.surrogates.curve import AbstractCurve
from identification.surrogates.unlisted import SURROGATES

__all__ = ["Trace", "missing_curves", "traced"]

_PEAKS: Final = 3
"""Spectral peaks per channel."""
_LEAST_SHARE: Final = 0.02
"""Fraction of the largest gain below which a curve is not reported."""


@dataclass(frozen=True)
class Trace:
    """Dependence of what one balance lacks on one signal."""

    equation: str
    """``electrical`` or ``mechanical``."""
    driver: str
    """The signal: current, voltage, speed, position, temperature or time."""
    gain: float
    """Predicted gain of the log likelihood."""
    share: float
    """Gain over that of the best curve [-]."""


def missing_curves(fit: Fit, policy: SelectionPolicy = DEFAULT) -> list[Score]:
    """Scores of curves, ripples and other unlisted terms, one per structure, best first."""
    scales = replace(scales_of(fit), frequencies=_peaks(fit))
    has_thermal = any(term.equation == "thermal" for term in fit.simulator.model.terms)
    candidates = [
        candidate
        for kind in SURROGATES
        # What an inexact law of the temperature leaves also differs between the runs.
        if not (has_thermal and issubclass(kind, CoefficientChange))
        for candidate in kind.candidates(scales)
    ]
    return gathered(screened(fit, candidates, policy))


def traced(scores: Sequence[Score]) -> tuple[Trace, ...]:
    """Curves of what a model lacks over each signal alone, best first, without negligible ones."""
    curves = [(s, s.candidate.term) for s in scores if isinstance(s.candidate.term, AbstractCurve)]
    alone = [(score.gain, term) for score, term in curves if not term.carrier]
    most = max((gain for gain, _ in alone), default=0.0)
    return tuple(
        Trace(term.equation, term.drivers[0], gain, gain / most)
        for gain, term in alone
        if gain > _LEAST_SHARE * most
    )


def _peaks(fit: Fit) -> tuple[float, ...]:
    """Frequencies of the largest peaks in the spectrum of the residual of either channel [Hz]."""
    records = fit.simulator.records
    pairs = list(zip(records, fit.equations.logged, strict=True))
    longest = max(pairs, key=lambda pair: pair[0].rows)[0]
    interval = sample_interval([longest])
    length = 2 * longest.rows
    found: list[float] = []
    for channel in range(2):
        power = np.zeros(length // 2 + 1)
        for record, logged in pairs:
            residual = (record.measured - logged)[:, channel] * record.weight[:, channel]
            power += np.abs(np.fft.rfft(residual - residual.mean(), length)) ** 2
        power[:4] = 0.0
        peaks = largest_peaks(power, _PEAKS, 4, np.finfo(np.float64).tiny)
        found += [at / (length * interval) for at in peaks]
    return tuple(sorted(set(found)))
