"""Normal prior of the initial states, and of the per-record amplitudes of effects among them.

The first samples of a record determine its initial current and speed.  The runs may not determine
an amplitude that is free in each record: an error of the logged temperature that is equal in all
records, for example, is the same as another Ra25 and Kt25.  Along such a direction only the prior
decides, so the prior belongs to the cost, and its size has to be that of the amplitudes that the
runs do determine.

Amplitudes of the error of a temperature log in coarse steps are also limited by the log: over a
constant stretch of it, the temperature differs from its level by no more than rounding does.

Source: MacKay, Neural Computation 4 (1992), 415-447, section 4 (evidence for a prior variance, and
the number of well-determined parameters).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.linear import solution
from identification.model.composite import MotorModel
from identification.model.excitation import Record
from identification.model.simulate import Simulator, initial_states
from identification.model.term import AbstractTemperature, AbstractTerm

if TYPE_CHECKING:
    from identification.fit.solve import Fit

__all__ = [
    "amplitude_sizes",
    "own_cost",
    "state_covariances",
    "state_precision",
    "state_prior",
    "term_values",
]


def own_cost(simulator: Simulator, states: Sequence[Array]) -> Array | float:
    """Negative log prior of the per-record amplitudes, zero without such states [-]."""
    cost: Array | float = 0.0
    for _, rows, size, root in _own(simulator.model):
        for state in states:
            cost = cost + 0.5 * np.sum((root @ state[rows] / size) ** 2, axis=0)
    for record, state in zip(simulator.records, states, strict=True):
        for own, errors, levels in _logged(simulator.model, record):
            cost = cost + 0.5 * np.sum((levels - (errors @ state[own]).T) ** 2, axis=-1)
    return cost


def state_precision(simulator: Simulator, k: int) -> Array:
    """Inverse variance of the broad prior of the initial state, (n_state,).

    The standard deviation is the range of the logged channel, 30 K for a temperature, and the
    natural scale for any other state.
    """
    size = simulator.records[k].span
    kinds = {"current": size[0], "speed": size[1], "temperature": 30.0}
    own = [
        kinds.get(state.follows, state.scale)
        for term in simulator.model.terms
        for state in term.states
    ]
    return np.asarray(1.0 / np.array([size[0], size[1], *own]) ** 2)


def state_prior(simulator: Simulator, k: int) -> tuple[Array, Array]:
    """Prior of the initial state of a record, with the levels of a coarse temperature log.

    Returns:
        (n_state, n_state) inverse covariance, and its product with the mean, (n_state,).
    """
    record = simulator.records[k]
    broad = state_precision(simulator, k)
    precision, pull = np.diag(broad), broad * initial_states(simulator.model, record)
    for _, own, size, root in _own(simulator.model):
        precision[np.ix_(own, own)] = root.T @ root / size**2
    for rows, errors, levels in _logged(simulator.model, record):
        precision[rows, rows] += errors.T @ errors
        pull[rows] += errors.T @ levels
    return precision, pull


def _logged(model: MotorModel, record: Record) -> Iterator[tuple[slice, Array, Array]]:
    """Levels of a coarse temperature log as measurements of the error of the log, for each term.

    Yields:
        Rows of the term in the state, (n_level, n_amplitude) error by a unit of each amplitude, and
        (n_level,) error that the log shows, both over the standard deviation of rounding.
    """
    (times, levels), at = record.levels, 2
    if not times.size:
        return
    rounding = record.resolution / np.sqrt(12.0)
    for term in model.terms:
        rows, at = slice(at, at + len(term.states)), at + len(term.states)
        if isinstance(term, AbstractTemperature):
            errors = term.log_error(times)
            if errors is not None:
                yield rows, errors / rounding, levels / rounding


def amplitude_sizes(fit: Fit) -> dict[str, float]:
    """Prior standard deviation of the per-record amplitudes of each term, one step of iteration.

    With g = sum(1 - variance / size^2), the number of amplitudes that the runs determine, the size
    becomes the root of the sum of squares over g, by the name of the term, in the unit of its
    amplitudes.  A fixed point maximises the evidence.  If the runs determine less than one
    amplitude, the present size remains.
    """
    sizes: dict[str, float] = {}
    covariances = state_covariances(fit)
    for name, rows, size, root in _own(fit.simulator.model):
        squares = sum(float(np.sum((root @ state[rows]) ** 2)) for state in fit.states)
        own = root @ covariances[:, rows[:, None], rows] @ root.T
        determined = float(np.sum(1.0 - np.diagonal(own, axis1=1, axis2=2) / size**2))
        sizes[name] = float(np.sqrt(squares / determined)) if determined >= 1.0 else size
    return sizes


def term_values(fit: Fit, term: AbstractTerm) -> dict[str, float]:
    """Parameters of a term by name, and `spread`, the size of its per-record amplitudes, if any."""
    values = {p.name: fit.by_name[f"{term.name}.{p.name}"] for p in term.parameters}
    if any(state.is_own for state in term.states):
        values["spread"] = amplitude_sizes(fit)[term.name]
    return values


def _own(model: MotorModel) -> list[tuple[str, NDArray[np.int64], float, Array]]:
    """Name, rows in the state, size and root of the prior of each term's per-record amplitudes."""
    found, at = [], 2
    for term in model.terms:
        own = [at + k for k, state in enumerate(term.states) if state.is_own]
        at += len(term.states)
        if own:
            size = next(state.scale for state in term.states if state.is_own)
            root = np.eye(len(own)) if term.own_root is None else term.own_root
            found.append((term.name, np.array(own, dtype=np.int64), float(size), root))
    return found


def state_covariances(fit: Fit) -> Array:
    """Covariances of the initial states, (n_record, n_state, n_state)."""
    equations = fit.equations
    covariance = equations.covariance()
    found = []
    for k, matrix in enumerate(equations.state_matrices):
        response = equations.state_response(k)
        found.append(solution(matrix, np.eye(len(matrix))) + response @ covariance @ response.T)
    return np.array(found)
