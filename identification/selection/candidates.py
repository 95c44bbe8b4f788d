"""Candidate terms of a model: their scales, enumeration, and the shortlist by predicted gain."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import CampaignScales, Candidate
from identification.effects.orders import HIGHEST_ORDER, orders_of
from identification.fit.solve import Fit
from identification.model.declared import DECLARED
from identification.model.excitation import sample_interval
from identification.selection.score import Score, gathered
from identification.surrogates.unlisted import LAWS

__all__ = ["candidates_of", "scales_of", "with_predicted_gain", "without_shared"]

_WORTH: Final = 2.0
"""Predicted gain that a candidate needs, by default."""
_COMMON: Final = 4.0
"""Predicted gain of a local effect over the median of the other runs, at least."""


def with_predicted_gain(scores: Sequence[Score], count: int, least: float = _WORTH) -> list[Score]:
    """Candidates with the largest predicted gain, one per variant and two per effect type.

    The scores are the best first; each kept one exceeds the gain `least`.
    """
    kinds: dict[str, int] = {}
    kept = []
    for score in gathered(scores):
        name = score.candidate.term.name
        kinds[name] = kinds.get(name, 0) + 1
        if kinds[name] <= 2 and score.gain > least:
            kept.append(score)
    return kept[:count]


def scales_of(fit: Fit) -> CampaignScales:
    """Scales of the campaign to which `fit` was fitted."""
    records = fit.simulator.records
    measured = np.concatenate([record.measured for record in records])
    voltage = np.concatenate([record.column("voltage") for record in records])
    size = np.sqrt(np.mean(measured**2, axis=0))
    size = np.where(size > 0, size, 1.0)
    return CampaignScales(
        records=tuple(records),
        current=float(size[0]),
        speed=float(size[1]),
        voltage=float(np.sqrt(np.mean(voltage**2))) or 1.0,
        torque=float(fit.by_name["Kt25"] * size[0]),
        interval=sample_interval(records),
        duration=float(max(record.time[-1] - record.time[0] for record in records)),
        values=fit.values[: len(DECLARED)],
        angle_logged=all(record.angle_logged for record in records),
        orders=orders_of(records, fit.residuals(), HIGHEST_ORDER),
        effects={name: value for name, value in fit.by_name.items() if "." in name},
    )


def candidates_of(fit: Fit, withheld: Collection[str]) -> list[Candidate]:
    """All structures of the effect types that are neither in the model, withheld nor excluded."""
    scales = scales_of(fit)
    absent = {term.name for term in fit.simulator.model.terms} | set(withheld)
    return [
        candidate
        for kind in (*CATALOGUE.values(), *LAWS)
        if kind.name not in absent and not kind.is_excluded(scales)
        for candidate in kind.candidates(scales)
    ]


def without_shared(scores: Sequence[Score]) -> list[Score]:
    """Drop local effects whose predicted gain the other runs share.

    Given an event in one run, the same effect in the other runs gains nothing.  Any other model
    error has about the same gain in every run, so the other runs serve as the control: the gain per
    affected run has to be at least four times the median of theirs.  What they gain without the
    event says nothing, because the parameters of the current model have absorbed a part of it: with
    a changed inertia in one run, J is wrong in all of them.
    """
    return [
        score
        for score in scores
        if score.control is None
        or score.gain >= _COMMON * score.control * len(score.candidate.term.runs)
    ]
