"""Validation runs with another inertia than the training runs.

A validation run with another disk or load is worse predicted by the true model than by a wrong one,
so that the search refuses effects that the motor has.  The torque balance of each run, a
regression over windows of samples, gives its inertia.  Inertias that differ between training runs
are found by the search (`inertia_change`); one that only validation runs have cannot be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median_low
from typing import Final

from identification.checks.consistency import Estimate, estimate_of
from identification.checks.finding import Finding, suspicion
from identification.ingest.run import Run

__all__ = ["other_inertia_findings"]

_OTHER: Final = math.log(1.35)
"""Least deviation of ln J, that of ln K between the runs of one motor; see `consistency`."""
_ALIKE: Final = math.log(1.1)
"""Largest deviation of ln J between training runs of one inertia."""
_ERRORS: Final = 5.0
"""Least deviation of ln J, over its standard error."""


def other_inertia_findings(training: Sequence[Run], validation: Sequence[Run]) -> list[Finding]:
    """Suspicions about validation runs whose inertia no training run has."""
    known = _sound(training)
    usual = median_low(e.inertia for e in known) if known else math.nan
    if not known or any(_far(e, usual) > _ALIKE for e in known):
        return []
    return [
        suspicion(
            "other_inertia",
            e.run,
            None,
            f"the inertia is {e.inertia:.3g} kg m^2 and that of the training runs {usual:.3g} "
            "kg m^2: another load is on the shaft, so that this run refutes effects that the "
            "training runs show",
            ("inertia relative to the training runs", e.inertia / usual, _limit(e, usual)),
            remedy="validate with the load of the training runs, or train with both loads",
        )
        for e in _sound(validation)
        if _far(e, usual) > max(_OTHER, _ERRORS * e.inertia_error)
    ]


def _sound(runs: Sequence[Run]) -> list[Estimate]:
    """Estimates of the runs whose balances determine the inertia."""
    found = [e for run in runs if (e := estimate_of(run)) is not None]
    return [
        e
        for e in found
        if e.is_sound and e.is_long and e.inertia > 0.0 and e.inertia_error < 1.0 / _ERRORS
    ]


def _far(e: Estimate, usual: float) -> float:
    """Deviation of ln J."""
    return abs(math.log(e.inertia / usual))


def _limit(e: Estimate, usual: float) -> float:
    """Limit of the ratio on the side of this estimate."""
    return math.exp(math.copysign(_OTHER, e.inertia - usual))
