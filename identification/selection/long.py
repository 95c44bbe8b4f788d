"""Search on long records: representative subset first, then all samples.

    subset    search the segments that `representative_subset` selects
    fit       fit the selected model to all samples, and also without each of its effects
    check     compare the simulation error of all samples with that of the subset

An effect has to lower the error by 2 % to be accepted.  If the error of all samples exceeds that of
the subset by less, no acceptable effect is missing outside the subset, and the search ends.
Otherwise (an event in one run, heating over minutes) the search continues on all samples from the
selected model.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial

import numpy as np

from identification.fit.campaign import Campaign
from identification.fit.solve import Fit
from identification.selection.omitted import removal_steps
from identification.selection.outcome import Found, Outcome
from identification.selection.policy import DEFAULT
from identification.selection.refit import with_known_amplitudes
from identification.selection.search import search
from identification.selection.subset import fitted_to, representative_subset
from identification.selection.trials import Trials
from identification.work import Budget

__all__ = ["search_long"]


def search_long(
    declared: Fit,
    campaign: Campaign,
    progress: Callable[[float], None] | None = None,
    work: float = np.inf,
    withheld: Collection[str] = (),
) -> Outcome:
    """Select the effects that the nominal model lacks, for records of any length.

    `progress` is called with the completed fraction [-], `work` is the operation budget.  The other
    arguments are those of `search`.
    """
    tell = progress or (lambda fraction: None)
    select = partial(search, withheld=withheld)
    part = representative_subset(campaign, declared)
    if part is None:
        return select(declared, campaign, progress, Budget(work))
    budget = Budget(work)
    segments, nominal = part
    effort = Budget(DEFAULT.subset_budget * work, within=budget)
    found = select(nominal, segments, lambda done: tell(0.6 * done), effort, is_part=True)
    trials = Trials(campaign, budget, tried=max(len(found.searched), 1))
    whole, effects = _confirmed(declared, found, trials)
    tell(0.8)
    if _excess(whole, found.fit) < DEFAULT.least_fall or budget.spent:
        complete = found.complete and not budget.spent
        return replace(found, fit=whole, effects=effects, complete=complete)
    begin = whole if effects else None
    more = select(declared, campaign, lambda done: tell(0.8 + 0.2 * done), budget, begin)
    if not more.complete:
        more = more.with_alternatives_of(effects)
    return replace(more, searched=(*found.searched, *more.searched))


def _excess(whole: Fit, part: Fit) -> float:
    """Log ratio of the error of all samples to that of the subset, summed over the channels."""
    counts = (whole.weighting.counts > 0) & (part.weighting.counts > 0)
    ratio = np.log(whole.weighting.deviation / part.weighting.deviation)
    return float(np.sum(ratio[counts]))


def _confirmed(declared: Fit, found: Outcome, trials: Trials) -> tuple[Fit, tuple[Found, ...]]:
    """The model of the subset fitted to all samples, without the effects that fail there."""
    if not found.effects:
        return declared, ()
    trials.evaluate(declared)
    # The model of the result is fitted whether or not the search has left operations for it.
    limits = replace(trials.limits(), budget=Budget())
    current = trials.evaluate(fitted_to(declared.simulator.records, found.fit, limits))
    kept: list[Found] = []
    for effect in found.effects:
        term = next(t for t in current.fit.simulator.model.terms if t.name == effect.name)
        simpler = trials.without(current, term)
        criteria = trials.criteria(current, simpler)
        if criteria.passed:
            is_open = current.is_undecided(simpler.fit)
            removal = removal_steps(current.fit, simpler.fit)
            kept.append(replace(effect, criteria=criteria, is_undecided=is_open, removal=removal))
        else:
            current = simpler
    return with_known_amplitudes(trials.final(current)), tuple(
        sorted(kept, key=lambda effect: -effect.criteria.gain)
    )
