"""Expected precision of the nominal parameters, and what to record to improve it.

The nominal model is fitted to informative segments of the runs.  The Fisher information of these
segments, scaled to all samples, gives the standard deviation that a fit of all runs can reach
(Cramer-Rao bound); the criterion of `identified` in the result is applied to it.  An effect that
the nominal model lacks makes the residual autocorrelated.  That lowers the effective sample
fraction, so the bound of a motor with effects is pessimistic rather than optimistic.

Source: Ljung, System Identification, 2nd edition (1999), section 7.4 (Cramer-Rao bound) and
chapter 13 (experiment design).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.fit.campaign import Campaign
from identification.fit.declared import fit_declared
from identification.fit.gains import current_gains, with_one_gain
from identification.fit.identifiability import precision_of
from identification.fit.noise import effective_fraction
from identification.model.declared import DECLARED
from identification.model.excitation import Record
from identification.preview.excitation import Excitation
from identification.preview.sampling import passed_unseen, rounded_up, sampling_advice
from identification.selection.subset import informative_segments

__all__ = ["Prospect", "interval_of", "prospects_of"]

_ROWS: Final = 20_000
"""Samples of the segments; enough for each parameter that all samples together determine."""
_MOST_SAMPLES: Final = 30.0
"""Ratio of samples up to which more of the same excitation is advised."""
_NO_INFORMATION: Final = 1e3
"""Ratio of a standard deviation to its limit from which the runs contain no information."""
_LEAST_SPAN: Final = 10.0
"""Smallest temperature span that is advised; below it, errors of a thermometer and differences
between winding and thermometer decide the slope [K]."""
_SLOPES: Final = {"alpha_Ra": "Ra25", "alpha_Kt": "Kt25"}

_ADVICE: Final = {
    "Ra25": "larger currents: start-up, reversal or load",
    "Kt25": "higher speeds",
    "J": "accelerations: steps or reversals of the voltage",
    "b": "several constant speeds without load, in both directions",
    "L": "voltage steps, sampled several times within L/Ra",
}


@dataclass(frozen=True)
class Prospect:
    """Expected precision of one parameter."""

    name: str
    """Parameter of the nominal model."""
    value: float
    """Estimate from the segments [unit]."""
    unit: str
    """Its unit."""
    sd: float
    """Standard deviation that a fit of all runs can reach; infinite if the runs contain no
    information on it [unit]."""
    identified: bool
    """Whether this precision satisfies the criterion of the result."""
    advice: str = ""
    """What to record so that it does; empty if it does."""


def prospects_of(
    records: Sequence[Record], excitation: Excitation
) -> tuple[list[Prospect], list[str]]:
    """Expected precision of each nominal parameter, and notes on the runs.

    Args:
        records: Records of runs of one motor without contradictions.
        excitation: Excitation of all runs together.

    Raises:
        ComputationError: The nominal model cannot be simulated.
    """
    rows = sum(record.rows for record in records)
    segments = informative_segments(records, min(_ROWS, rows))
    fit = fit_declared(segments, "zoh")
    campaign = Campaign((), (), tuple(segments), (), (), ())
    if gains := current_gains(fit, campaign):
        campaign = with_one_gain(campaign, gains)
        fit = fit_declared(campaign.training, "zoh")
    used = sum(record.rows for record in segments)
    precision = precision_of(fit, effective_fraction(fit))
    # The information grows with the number of samples.
    gain = math.sqrt(rows / used)
    relative = {name: p.sd / gain / abs(p.estimate) for name, p in precision.items() if p.estimate}
    values, interval = {n: p.estimate for n, p in precision.items()}, interval_of(records)
    faster, unseen = sampling_advice(values, interval), passed_unseen(values, interval)
    found = []
    for parameter in DECLARED:
        bound = precision[parameter.name]
        # A bound far beyond the criterion is only rounding of an undetermined direction.
        is_known = bound.sd < _NO_INFORMATION * bound.limit and parameter.name not in unseen
        sd = bound.sd / gain if is_known else np.inf
        # An estimate of zero, such as of a friction at its bound, cannot be identified.
        lacking = sd / bound.limit if bound.limit > 0.0 else np.inf
        advice = ""
        if parameter.name in _SLOPES and not lacking < 1.0:
            base = relative.get(_SLOPES[parameter.name], np.inf)
            advice = _warmer(excitation, lacking, base, bound.limit)
        elif not lacking < 1.0:
            more = _more(parameter.name, lacking)
            advice = f"{faster[parameter.name]}; {more}" if parameter.name in faster else more
        found.append(
            Prospect(parameter.name, bound.estimate, parameter.unit, sd, lacking < 1.0, advice)
        )
    return found, [str(warning) for warning in campaign.warnings]


def interval_of(records: Sequence[Record]) -> float:
    """Median sampling interval of all records [s]."""
    return float(np.median(np.concatenate([np.diff(record.time) for record in records])))


def _warmer(excitation: Excitation, lacking: float, relative: float, limit: float) -> str:
    """Temperature span that determines a temperature coefficient.

    Two groups of runs at temperatures dT apart give the slope with a standard deviation of sqrt(2)
    times the relative standard deviation of the coefficient over dT.
    """
    if excitation.temperature_degC is None:
        return "log the winding temperature (temperature_degC), cold and hot"
    span = excitation.temperature_span * lacking if excitation.temperature_span > 1.0 else np.inf
    span = min(span, math.sqrt(2.0) * relative / limit) if np.isfinite(relative) else span
    span = max(span, _LEAST_SPAN, excitation.temperature_span)
    wanted = f"at least {rounded_up(span)} K apart" if span < 300.0 else "as far apart as possible"
    return f"record cold and hot runs, {wanted} (now {excitation.temperature_span:.1f} K)"


def _more(name: str, lacking: float) -> str:
    ratio = lacking**2
    if ratio < _MOST_SAMPLES:
        return f"record {rounded_up(ratio)} times as long, or {_ADVICE[name]}"
    return f"record {_ADVICE[name]}"
