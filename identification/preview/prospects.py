"""Expected precision of the nominal parameters, and what to record to improve it.

The nominal model is fitted to informative segments of the runs.  The Fisher information of these
segments, scaled to all samples, gives the standard deviation that a fit of all runs can reach
(Cramer-Rao bound); the criterion of `identified` in the result is applied to it.  An effect that
the nominal model lacks makes the residual autocorrelated.  That lowers the effective sample
fraction, so the bound of a motor with effects is pessimistic rather than optimistic.

The sampling interval is compared with the time constants of the motor.  The two balances at 25 degC
have the poles s of

    s^2 + (Ra/L + b/J) s + (Kt^2 + Ra b)/(L J) = 0

Time constants that the runs do not determine are arbitrary: L/Ra is then that of a typical winding,
and J Ra/Kt^2 at least that of a fast motor.  A transient is resolved if the sampling interval is at
most its time constant 1/abs(s): in a longer one, more than 63 % of it pass unseen.  A complex pair
counts as one transient of both balances.

Source: Ljung, System Identification, 2nd edition (1999), section 7.4 (Cramer-Rao bound), chapter 13
(experiment design), and section 13.7 (choice of the sampling interval), where ten samples in the
period of the bandwidth, 1.6 in a time constant, are the rule.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.checks.finding import Finding
from identification.checks.plausible import time_constant_findings
from identification.design.models import TYPICAL_ELECTRICAL_S
from identification.diagnosis.residual import pooled_errors
from identification.fit.campaign import Campaign
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.gains import current_gains, with_one_gain
from identification.fit.identifiability import precision_of
from identification.fit.solve import Fit
from identification.model.declared import DECLARED
from identification.model.excitation import Record, sample_interval
from identification.preview.excitation import Excitation
from identification.reporting.summary import POOR_FIT
from identification.selection.subset import informative_segments

__all__ = ["Prospect", "prospects_of", "sampling_note"]

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

_FAST_MECHANICAL_S: Final = 5e-3
"""Shortest mechanical time constant of most motors without a load; docs/record-runs.md [s]."""

_WANTED: Final = {"L": 5.0, "J": 20.0}
"""Advised number of samples in the time constant that determines the parameter."""
_NAMES: Final = {"L": "electrical", "J": "mechanical"}


@dataclass(frozen=True)
class Prospect:
    """Expected precision of one parameter."""

    name: str
    """Parameter of the nominal model."""
    value: float
    """Estimate from the segments [unit]."""
    unit: str
    sd: float
    """Standard deviation that a fit of all runs can reach; infinite if the runs contain no
    information on it [unit]."""
    identified: bool
    """True if this precision satisfies the criterion of the result."""
    advice: str = ""
    """What to record so that it does; empty if it does."""


def prospects_of(
    records: Sequence[Record], excitation: Excitation
) -> tuple[list[Prospect], list[Finding], list[str]]:
    """Expected precision of each nominal parameter, suspicions about it, and notes on the runs.

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
    values, interval = {n: p.estimate for n, p in precision.items()}, sample_interval(records)
    known = {name for name, p in precision.items() if p.sd / gain < p.limit}
    is_typical = not {"Ra25", "L"} <= known
    values |= _assumed(values, known)
    poor = _poor_fit_note(fit)
    # A model that explains little has no time constants.
    passed = {} if poor else _unresolved(values, interval)
    faster = _sampling_advice(passed, interval)
    # An electrical transient alone leaves its trace in the speed, from which a fit determines L.
    # Where the mechanical one passes within an interval, too, J and L follow from the instants of
    # the voltage steps alone: a step between two samples changes them by orders of magnitude.
    unseen = set(passed) if "J" in passed else set()
    cold = {*_SLOPES.values()} - {*faster}
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
        elif not lacking < 1.0 and bound.is_bridged and parameter.name in cold:
            advice = "record runs near 25 °C, or cold and hot runs"
        elif not lacking < 1.0:
            more = _more(parameter.name, lacking)
            advice = f"{faster[parameter.name]}; {more}" if parameter.name in faster else more
        found.append(
            Prospect(parameter.name, bound.estimate, parameter.unit, sd, lacking < 1.0, advice)
        )
    first = poor or sampling_note(values, interval, is_typical)
    notes = ([first] if first else []) + [str(warning) for warning in campaign.warnings]
    return found, [] if poor else _unusual(found), notes


def _assumed(values: Mapping[str, float], known: Set[str]) -> dict[str, float]:
    """Values of an inductance and an inertia that the runs do not determine; see the module."""
    assumed = {}
    if not {"Ra25", "L"} <= known:
        assumed["L"] = TYPICAL_ELECTRICAL_S * values["Ra25"]
    if not {"Ra25", "Kt25", "J"} <= known:
        assumed["J"] = max(values["J"], _inertia_of_a_fast_motor(values))
    return assumed


def _unusual(prospects: Sequence[Prospect]) -> list[Finding]:
    """Suspicions about time constants that the runs determine and motors do not have."""
    return time_constant_findings(
        {one.name: one.value for one in prospects},
        {one.name: one.identified for one in prospects},
    )


def _poor_fit_note(fit: Fit) -> str:
    """Remark on a nominal model that explains little of every channel that changes, or empty."""
    measured = [record.measured for record in fit.simulator.records]
    errors = {
        name: pooled_errors(
            [residual[:, k] for residual in fit.residuals()], [one[:, k] for one in measured]
        ).nrmse
        for k, name in enumerate(("current", "speed"))
        if any(np.ptp(one[:, k]) > 0.0 for one in measured)
    }
    if not errors or min(errors.values()) <= POOR_FIT:
        return ""
    little = " and ".join(f"the {name} (NRMSE {100 * x:.3g} %)" for name, x in errors.items())
    return (
        f"the nominal model explains little of {little}, so that no time constant and no sampling "
        "rate follow from it; check that voltage_V is the voltage at the motor terminals and not "
        "that of a supply or of a set point, and that all channels are of one motor; else a large "
        "effect is missing, such as friction, or the signals are mostly noise"
    )


def _inertia_of_a_fast_motor(values: Mapping[str, float]) -> float:
    """Inertia with which a motor has the shortest usual mechanical time constant [kg m^2]."""
    ra, kt, friction = (values[name] for name in ("Ra25", "Kt25", "b"))
    return _FAST_MECHANICAL_S * (kt**2 / ra + friction) if ra > 0.0 else 0.0


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
    wanted = f"at least {_rounded_up(span)} K apart" if span < 300.0 else "as far apart as possible"
    return f"record cold and hot runs, {wanted} (now {excitation.temperature_span:.1f} K)"


def _more(name: str, lacking: float) -> str:
    ratio = lacking**2
    if ratio < _MOST_SAMPLES:
        return f"record {_rounded_up(ratio)} times as long, or {_ADVICE[name]}"
    return f"record {_ADVICE[name]}"


def _sampling_advice(passed: Mapping[str, float], interval: float) -> dict[str, str]:
    """Sampling rate to record at, for each parameter whose transient is not resolved.

    That is L where the electrical transient is shorter than the interval [s], and all parameters
    without a temperature where the mechanical one is, too.
    """
    rates = {name: _WANTED[name] / time for name, time in passed.items()}
    advice = {
        name: f"sample at {_rounded_up(rate)} Hz or faster (now {1.0 / interval:.4g} Hz)"
        for name, rate in rates.items()
    }
    if len(advice) < len(_NAMES):
        return advice
    return dict.fromkeys(("Ra25", "Kt25", "J", "b", "L"), advice[max(rates, key=rates.__getitem__)])


def sampling_note(values: Mapping[str, float], interval: float, is_typical: bool = False) -> str:
    """Remark on transients that are shorter than the interval [s]; empty if there are none.

    `is_typical` says that the runs do not determine L, which is that of a typical winding.
    """
    passed = _unresolved(values, interval)
    if not passed:
        return ""
    advice = _sampling_advice(passed, interval)
    now = _milliseconds(interval)
    if len(passed) == len(_NAMES):
        return (
            f"the sampling interval of {now} is too long for this motor: it resolves neither the "
            "electrical nor the mechanical transient, and the estimates rest on the exact "
            f"instants of the voltage steps; J and L cannot be identified; {advice['J']}"
        )
    name, time = next(iter(passed.items()))
    if name == "L" and is_typical:
        return (
            f"the sampling interval of {now} does not show the electrical transient, so L is not "
            "identifiable; L/Ra of a small motor is typically "
            f"{_milliseconds(TYPICAL_ELECTRICAL_S)}; {advice[name]}"
        )
    return (
        f"the sampling interval of {now} does not resolve the {_NAMES[name]} time constant of "
        f"{_milliseconds(time)}, and the estimate of {name} rests on the exact instants of the "
        f"voltage steps; {advice[name]}"
    )


def _rounded_up(value: float) -> str:
    """Two significant digits of a positive number, rounded up."""
    step = 10.0 ** (math.floor(math.log10(max(value, 1e-300))) - 1)
    return f"{math.ceil(value / step - 1e-9) * step:.6g}"


def _unresolved(values: Mapping[str, float], interval: float) -> dict[str, float]:
    """Time constants below the sampling interval [s], by the parameter that each determines."""
    ra, kt, inertia, friction, inductance = (values[n] for n in ("Ra25", "Kt25", "J", "b", "L"))
    if not (ra > 0.0 and inertia > 0.0 and inductance > 0.0):
        return {}
    sum_of_poles = ra / inductance + friction / inertia
    product = (kt**2 + ra * friction) / (inductance * inertia)
    slow, fast = sorted(np.abs(np.roots([1.0, sum_of_poles, product])).tolist())
    is_electrical_faster = inductance / ra < inertia * ra / (kt**2 + ra * friction)
    of_fast, of_slow = ("L", "J") if is_electrical_faster else ("J", "L")
    return {name: 1.0 / s for name, s in ((of_fast, fast), (of_slow, slow)) if interval * s > 1.0}


def _milliseconds(time: float) -> str:
    return f"{1e3 * time:.3g} ms"
