"""Values of an effect whose size is free in each run, such as the load of a winch.

Such a size is a constant state of each record.  The records of one run are combined by their
inverse variances, as independent measurements of one value.

Source: Bevington and Robinson, Data Reduction and Error Analysis (2003), section 4.1 (weighted
mean).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from identification.effects.effect import AbstractEffect
from identification.fit.own_states import state_covariances
from identification.fit.solve import Fit

__all__ = ["run_values"]

_QUANTILE: Final = 1.6448536269514722
"""95 % quantile of the standard normal distribution."""
_DETERMINED: Final = 0.5
"""Largest standard deviation of a value that the run determines, over that of its prior."""


def run_values(term: AbstractEffect, final: Fit, fraction: float) -> list[dict[str, Any]]:
    """Entry of each training run: file, and PARAMETER by name; empty if the size is common.

    `fraction` is the effective sample fraction of the final fit [-].
    """
    if not term.varies:
        return []
    names: dict[int, str] = {record.run: record.name for record in final.simulator.records}
    first = _first_state(term, final)
    owned = [(first + k, state) for k, state in enumerate(term.states) if state.is_own]
    reference = {} if term.reference_run is None else {term.reference_run: (0.0, 0.0)}
    combined = {k: {**dict(_of_runs(final, k, fraction)), **reference} for k, _ in owned}
    return [
        {
            "file": name,
            "values": {
                state.name: _entry(*combined[k][run], state.scale, state.unit) for k, state in owned
            },
        }
        for run, name in names.items()
    ]


def _first_state(term: AbstractEffect, final: Fit) -> int:
    """Row of the term's first state; those of current and speed come before all terms."""
    row = 2
    for other in final.simulator.model.terms:
        if other is term:
            break
        row += len(other.states)
    return row


def _of_runs(final: Fit, row: int, fraction: float) -> Iterator[tuple[int, tuple[float, float]]]:
    """Index of each run, with the weighted mean of the state over its records and its deviation."""
    runs = np.array([record.run for record in final.simulator.records])
    values = np.array([state[row] for state in final.states])
    weights = fraction / state_covariances(final)[:, row, row]
    for run in np.unique(runs):
        here = runs == run
        total = float(np.sum(weights[here]))
        yield int(run), (float(weights[here] @ values[here]) / total, total**-0.5)


def _entry(mean: float, deviation: float, size: float, unit: str) -> dict[str, Any]:
    """PARAMETER of a normal distribution; `size` is the standard deviation of its prior."""
    return {
        "mean": mean,
        "sd": deviation,
        "q05": mean - _QUANTILE * deviation,
        "median": mean,
        "q95": mean + _QUANTILE * deviation,
        "unit": unit,
        "identified": deviation < _DETERMINED * size,
    }
