"""Parameter drift between two refits, with false discovery rate control over the fleet.

The drift d is the current median minus the previous median; s and s0 are the two posterior standard
deviations.  If the motor did not change and the two refits share no data, d / sqrt(s^2 + s0^2) is
approximately standard normal, which gives each comparison a two-sided p-value.

A table of 200 motors makes 1400 comparisons, so some differences are large by chance alone.  The
p-values of a table are therefore adjusted together by the Benjamini-Yekutieli procedure (Annals of
Statistics 29, 2001, 1165-1188), which controls the false discovery rate under any dependence
between the comparisons: at most one in twenty of the significant differences is expected to be
false.  For a single motor, significance then requires about three combined standard deviations; for
a table with few changes among 1400 comparisons, about four and a half.

Refits that share training runs share their noise.  Their difference is then smaller than the
combined standard deviation implies, so the test is conservative.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from identification.fleet.refit import Estimate, Refit
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["FALSE_DISCOVERY_RATE", "Drift", "adjusted", "drift_of", "drifts"]

FALSE_DISCOVERY_RATE = 0.05
"""Expected fraction of false positives among the significant differences [-]."""


@dataclass(frozen=True)
class Drift:
    """Change of one parameter since the last refit."""

    absolute: float
    """Current median minus previous median, in the unit of the parameter."""
    relative: float | None
    """`absolute` over the magnitude of the previous median [-]; None if that is zero."""
    sds: float | None
    """`absolute` over the combined standard deviation [-]; None if that is zero."""
    probability: float | None
    """Two-sided p-value of this comparison; `drifts` replaces it by the p-value adjusted over the
    whole table."""
    is_significant: bool | None = None
    """True if the adjusted p-value is at most `FALSE_DISCOVERY_RATE`; None before the adjustment
    and if there is no p-value."""


def drift_of(now: Estimate | None, before: Estimate | None) -> Drift | None:
    """Change of a parameter; None if one of the two refits does not identify it."""
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
    """Changes of each motor since its previous refit, with p-values adjusted over all motors."""
    found = [
        {
            name: drift
            for name in DECLARED_PARAMETERS
            if refit.previous is not None
            and (drift := drift_of(refit.estimates.get(name), refit.previous.estimates.get(name)))
        }
        for refit in refits
    ]
    p_values = [one.probability for changes in found for one in changes.values()]
    remaining = iter(adjusted([p for p in p_values if p is not None]))
    for changes in found:
        for name, one in changes.items():
            if one.probability is not None:
                p = next(remaining)
                judged = p <= FALSE_DISCOVERY_RATE
                changes[name] = replace(one, probability=p, is_significant=judged)
    return found


def adjusted(p_values: Sequence[float]) -> list[float]:
    """p-values adjusted together by the procedure of Benjamini and Yekutieli."""
    if not p_values:
        return []
    # Lazy import: loading scipy.stats takes longer than building the table.
    from scipy.stats import false_discovery_control

    return [float(p) for p in false_discovery_control(p_values, method="by")]
