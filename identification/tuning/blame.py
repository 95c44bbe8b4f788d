"""Contribution of each parameter's uncertainty to the failure of a specification.

The draws are conditioned on one parameter at its mean: the others are shifted along their linear
regression on it, so that correlated parameters keep their dependence.  The probability with these
draws is the one that would hold if the parameter were known.

    p(x_j known) - p          rise of the probability
    S_j = Var E(d | x_j) / Var d          first-order Sobol index of the distance d from the limits

E(d | x_j) is the mean over groups of draws with similar x_j, which needs no further simulation.
S_j is corrected for the number of groups.

Source: Saltelli et al., Global Sensitivity Analysis: The Primer, Wiley 2008, section 1.2
(first-order index, factor fixing); Plischke, Borgonovo and Smith, Eur. J. Oper. Res. 226
(2013), 536-550 (estimation from given data).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from identification.arrays import Array
from identification.tuning.judge import Judge, slack_at
from identification.tuning.motor import UncertainMotor

__all__ = ["blamed", "known"]

_LEAST_DRAWS: Final = 20
_MOST_DRAWS: Final = 150
_GROUP: Final = 15
_MOST_GROUPS: Final = 10
_LEAST_SPREAD: Final = 1e-12


def blamed(judge: Judge, gains: Array, samples: int, probability: float) -> list[dict[str, Any]]:
    """Probability and distance from the limits if one parameter were known, largest rise first.

    One entry for each uncertain parameter, and one for the temperature at the middle of its range;
    empty with fewer than 20 draws.  The gains are (4,).
    """
    motor = judge.motor.thinned(_MOST_DRAWS)
    if motor.count < _LEAST_DRAWS:
        return []
    found = judge.of(motor).judged(gains[:, None], samples)
    before = found.of_draws[0]
    entries = []
    for index, parameter in enumerate(motor.model.parameters):
        values = motor.values[index]
        if values.std() <= _LEAST_SPREAD * np.abs(values).max():
            continue
        after = judge.of(known(motor, index)).judged(gains[:, None], samples).of_draws[0]
        entries.append(
            _entry(parameter.name, before, after, probability)
            | {"sobol": _first_order(values, before)}
        )
    if len(judge.temperatures) > 1:
        middle = 0.5 * (judge.temperatures[0] + judge.temperatures[-1])
        after = judge.of(motor, [middle]).judged(gains[:, None], samples).of_draws[0]
        entries.append(_entry("temperature", before, after, probability) | {"sobol": None})
    return sorted(entries, key=lambda e: (-e["rise"], -(e["slack_rise"] or 0.0)))


def known(motor: UncertainMotor, index: int) -> UncertainMotor:
    """The motor with one parameter at its mean, and the others as the draws predict them then.

    Positive parameters are regressed by their logarithms, so they stay positive.
    """
    positive = (motor.values > 0).all(axis=1)
    rows = motor.values.copy()
    rows[positive] = np.log(rows[positive])
    deviation = rows - rows.mean(axis=1, keepdims=True)
    fixed = deviation[index]
    slope = deviation @ fixed / (fixed @ fixed)
    rows -= slope[:, None] * fixed
    rows[positive] = np.exp(rows[positive])
    # A parameter of at least zero may have draws at zero, where the logarithm does not exist.
    lowest = motor.values.min(axis=1, keepdims=True)
    return replace(motor, values=np.where(lowest >= 0, np.maximum(rows, 0.0), rows))


def _entry(name: str, before: Array, after: Array, probability: float) -> dict[str, Any]:
    share = float((after >= 0).mean())
    slack, known_slack = (float(slack_at(one, probability)) for one in (before, after))
    has_both = np.isfinite([slack, known_slack]).all()
    return {
        "parameter": name,
        "probability": share,
        "rise": share - float((before >= 0).mean()),
        "slack_rise": known_slack - slack if has_both else None,
    }


def _first_order(values: Array, slack: Array) -> float | None:
    """First-order Sobol index of the distance; None without variance."""
    bounded = np.clip(slack, -1.0, 1.0)
    whole = float(bounded.var())
    if not whole > 0:
        return None
    count = min(_MOST_GROUPS, values.size // _GROUP) or 1
    groups = np.array_split(bounded[np.argsort(values, kind="stable")], count)
    within = sum(group.size * float(group.var()) for group in groups) / values.size
    # Epsilon squared: unbiased within-group variance, so that noise alone gives zero.
    corrected = within * values.size / (values.size - count)
    total = whole * values.size / (values.size - 1)
    return float(np.clip(1.0 - corrected / total, 0.0, 1.0))
