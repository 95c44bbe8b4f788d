"""Consider covariance of a value that runs differ in, relative to one of them.

If each run has its own gain of a sensor or the voltage, its own resistance or torque constant, the
runs determine the ratios only.  The parameters are those of the first run, and which run has the
usual value is unknown.  The first run may differ from it by as much as the others from the first,
so the change of the parameters by the root mean square of the differences is one standard deviation
of an error that joins the intervals.

A difference may also be a temperature dependence that no law describes.  A temperature coefficient
changes by the difference over the standard deviation of the mean temperatures of the runs, at most
by the standard deviation of its prior.

If some runs have another value than the others, the parameters are those of the others.  The usual
value is that of the former with a probability of their share among the runs.

Source: Schmidt, in Advances in Control Systems 3 (1966), 293-340 (consider covariance).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.fit.solve import Fit
from identification.selection.omitted import OmittedTerm
from identification.surrogates.gain import InEachRun, InSomeRuns

__all__ = ["REFERENCE_RUN", "reference_runs"]

REFERENCE_RUN: Final = "reference_run"
"""Name of the terms."""

_COEFFICIENTS: Final = {"Ra25": "alpha_Ra", "Kt25": "alpha_Kt"}
"""Temperature coefficient of a parameter."""


def reference_runs(fit: Fit) -> tuple[OmittedTerm, ...]:
    """Parameter changes if other runs have the usual value; empty if all runs agree."""
    values = fit.by_name
    found = []
    for term in fit.simulator.model.terms:
        if not isinstance(term, InEachRun | InSomeRuns):
            continue
        spread, probability = _difference(term, fit)
        changes = [{name: power * spread * values[name] for name, power in term.powers.items()}]
        warmth, scatter = _temperatures(fit)
        for name in [name for name in _COEFFICIENTS if name in term.powers]:
            coefficient = _COEFFICIENTS[name]
            k = fit.coordinates.names.index(coefficient)
            slope = float(fit.coordinates.slopes(fit.position)[k] * fit.coordinates.prior_sd[k])
            if scatter > 0.0:
                slope = min(slope, spread / scatter)
            changes.append({coefficient: slope, name: -slope * warmth * values[name]})
        found += [
            OmittedTerm(REFERENCE_RUN, None, None, _in_search(fit, one), possible=probability)
            for one in changes
        ]
    return tuple(found)


def _in_search(fit: Fit, changes: dict[str, float]) -> dict[str, float]:
    """Changes of physical values in search coordinates."""
    slopes = dict(zip(fit.coordinates.names, fit.coordinates.slopes(fit.position), strict=True))
    return {name: float(change / slopes[name]) for name, change in changes.items()}


def _temperatures(fit: Fit) -> tuple[float, float]:
    """Mean of the mean temperatures of the runs above 25 degC, and their deviation [K]."""
    records = fit.simulator.records
    runs = [
        np.mean(np.concatenate([one.column("temperature") for one in records if one.run == run]))
        for run in sorted({record.run for record in records})
    ]
    return float(np.mean(runs)) - 25.0, float(np.std(runs))


def _difference(term: InEachRun | InSomeRuns, fit: Fit) -> tuple[float, float]:
    """Difference between the runs [-], and the probability that the parameters differ by it."""
    if isinstance(term, InEachRun):
        return term.gain_size, 1.0
    number = len({record.run for record in fit.simulator.records})
    return abs(fit.by_name[f"{term.name}.change"]), len(term.runs) / number
