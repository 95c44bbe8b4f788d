"""How far a parameter has moved since the last refit, and whether that is more than chance.

The difference of two medians is d, their standard deviations are s and s0.  If the motor did not
change and the two refits share no measurement, d / sqrt(s^2 + s0^2) is close to standard normal,
which gives each comparison a two-sided probability of a difference as large by chance.

A table of 200 motors makes 1400 comparisons, of which some are large by chance alone.  So the
probabilities of a whole table are corrected together for the false discovery rate (Benjamini and
Yekutieli, Annals of Statistics 29, 2001, 1165-1188, which holds however the comparisons depend on
each other): of the differences that are called significant, at most one in twenty is expected to be
chance.  For one motor alone that asks for about three combined standard deviations, for a table
with few changes among 1400 comparisons for about four and a half.

Refits that share training runs share their noise, so their difference is smaller than the combined
standard deviation says, and what is called significant is so all the more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from identification.fleet.refit import Estimate, Refit
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["FALSE_DISCOVERY_RATE", "Drift", "drift_of", "drifts"]

FALSE_DISCOVERY_RATE = 0.05
"""Expected share of chance among the differences that are called significant."""


@dataclass(frozen=True)
class Drift:
    """Change of one parameter since the last refit.

    Args:
        absolute: Median now less median before, in the unit of the parameter.
        relative: The same over the size of the median before; None where that is zero.
        sds: The same over the combined standard deviation; None where that is zero.
        probability: Two-sided probability of a difference as large by chance, for this one
            comparison; after `drifts`, corrected for all of a table.
        is_significant: Whether the corrected probability is at most `FALSE_DISCOVERY_RATE`; None
            before the correction and where there is no probability.
    """

    absolute: float
    relative: float | None
    sds: float | None
    probability: float | None
    is_significant: bool | None = None


def drift_of(now: Estimate | None, before: Estimate | None) -> Drift | None:
    """Change of a parameter; None where one of the two is not determined by its data."""
    newer = now.usable if now else None
    older = before.usable if before else None
    if newer is None or older is None:
        return None
    absolute = newer[0] - older[0]
    spread = math.hypot(newer[1], older[1])
    sds = absolute / spread if spread > 0.0 else None
    return Drift(
        absolute=absolute,
        relative=absolute / abs(older[0]) if older[0] else None,
        sds=sds,
        probability=None if sds is None else math.erfc(abs(sds) / math.sqrt(2.0)),
    )


def drifts(refits: Sequence[Refit]) -> list[dict[str, Drift]]:
    """Changes of all motors against their previous refits, judged together.

    Args:
        refits: All motors of a table.

    Returns:
        For each motor the changes by parameter; empty where there was no refit before.
    """
    found = [
        {
            name: drift
            for name in DECLARED_PARAMETERS
            if refit.previous is not None
            and (drift := drift_of(refit.estimates.get(name), refit.previous.estimates.get(name)))
        }
        for refit in refits
    ]
    places = [
        (row, name, drift.probability)
        for row, changes in enumerate(found)
        for name, drift in changes.items()
        if drift.probability is not None
    ]
    if places:
        # Imported where it is needed: it takes longer to load than the table takes to make.
        from scipy.stats import false_discovery_control

        corrected = false_discovery_control([p for _, _, p in places], method="by")
        for (row, name, _), probability in zip(places, corrected.tolist(), strict=True):
            found[row][name] = replace(
                found[row][name],
                probability=probability,
                is_significant=probability <= FALSE_DISCOVERY_RATE,
            )
    return found
