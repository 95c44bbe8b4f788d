"""Probable causes of the change between two campaigns of one motor.

The change d is the vector of differences of the parameters that both refits determine: of the
logarithm for positive parameters, and relative to a typical coefficient for the temperature
coefficients.  Its covariance is

    C = C_now + C_before + r^2 I

with the posterior covariances and the repeatability r of campaigns on one bench.

Test.  For an unchanged motor d' C^-1 d is chi-squared, which gives one p-value for each motor.  A
result without correlations allows only the Bonferroni bound of the single parameters.  The p-values
of all motors are adjusted together, as in `identification.fleet.drift`.

Explanation.  Under a cause, d ~ N(a u, C) with a direction u of `identification.fleet.causes` and a
size a > 0, the largest relative change.  The prior of a is half-normal, mixed with equal weights
over scales of 0.3 to 30 % and over the directions of the cause, so each Bayes factor is a sum of
closed forms (a scale mixture as in Liang et al., JASA 103, 2008, 410-423).  Competitors are no
change, d ~ N(0, C), and a change of every parameter, d ~ N(0, C + s^2 I), for several or unlisted
causes.

If the two final models have different effects, parameters of the same equations are not comparable
and are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.arrays import Array
from identification.fleet.causes import CAUSES
from identification.fleet.drift import FALSE_DISCOVERY_RATE, adjusted
from identification.fleet.refit import Estimate, Refit

__all__ = ["NONE", "REPEATABILITY", "UNDECIDED", "UNLISTED", "Explanation", "explanations"]

NONE = "none"
UNDECIDED = "undecided"
UNLISTED = "unlisted"
REPEATABILITY = 0.002
"""Relative standard deviation between campaigns of an unchanged motor on one bench [-]."""

_TYPICAL = {"alpha_Ra": 3.9e-3, "alpha_Kt": -1.1e-3}
_SCALES = (0.003, 0.01, 0.03, 0.1, 0.3)
_PRIOR_NONE, _PRIOR_UNLISTED = 0.5, 0.1
_WIDEST = 0.5
_DECIDED, _LISTED = 0.5, 0.05
_INVOLVED = {
    "electrical": {"Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "L"},
    "mechanical": {"J", "b"},
    "thermal": {"Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "b"},
}


@dataclass(frozen=True)
class Explanation:
    """Change of one motor since its last refit and the probabilities of its causes."""

    compared: tuple[str, ...]
    """Names of the compared parameters and effect sizes; empty if none is comparable."""
    probability: float | None
    """p-value of an unchanged motor; `explanations` adjusts it over the table."""
    causes: Mapping[str, float] = field(default_factory=dict)
    """Posterior probabilities of all causes, of `NONE` and of `UNLISTED`, the most probable
    first."""
    changes: Mapping[str, float] = field(default_factory=dict)
    """Relative change of each parameter under the most probable cause."""
    differing: tuple[str, ...] = ()
    """Effects that only one of the two final models has."""
    is_significant: bool | None = None
    """True if the adjusted p-value is at most the false discovery rate."""

    @property
    def cause(self) -> str:
        """Most probable cause of a significant change, or `UNDECIDED`; empty without one."""
        if not self.is_significant:
            return ""
        name, probability = next(iter(self.causes.items()))
        return name if probability >= _DECIDED else UNDECIDED

    @property
    def likely(self) -> dict[str, float]:
        """Causes with a probability of at least 5 %; empty without a significant change."""
        if not self.is_significant:
            return {}
        return {name: p for name, p in self.causes.items() if p >= _LISTED}


def explanations(refits: Sequence[Refit]) -> list[Explanation | None]:
    """Explanations of all motors, with p-values adjusted over the table; None without a refit."""
    found = [None if r.previous is None else _explain(r, r.previous) for r in refits]
    p_values = [one.probability for one in found if one and one.probability is not None]
    remaining = iter(adjusted(p_values))
    return [
        replace(one, probability=(p := next(remaining)), is_significant=p <= FALSE_DISCOVERY_RATE)
        if one and one.probability is not None
        else one
        for one in found
    ]


def _explain(now: Refit, before: Refit) -> Explanation:
    differing = tuple(sorted({*now.equations.items()} ^ {*before.equations.items()}))
    effects = tuple(dict.fromkeys(name for name, _ in differing))
    change = _change(now, before, {equation for _, equation in differing})
    if not change.names:
        return Explanation((), None, differing=effects)
    causes, changes = _probabilities(change)
    return Explanation(change.names, change.p_value, causes, changes, effects)


@dataclass(frozen=True)
class _Change:
    """Difference of two refits in `names`, its covariance, and the values before."""

    names: tuple[str, ...]
    difference: Array
    covariance: Array
    has_correlation: bool
    before: Mapping[str, float]

    @property
    def p_value(self) -> float:
        """Probability of such a change of an unchanged motor."""
        # Lazy import: loading SciPy takes longer than building the table.
        from scipy.special import chdtrc, erfc

        if self.has_correlation:
            squared = float(self.difference @ np.linalg.solve(self.covariance, self.difference))
            return float(chdtrc(len(self.names), max(squared, 0.0)))
        largest = float(np.abs(self.difference / np.sqrt(np.diag(self.covariance))).max())
        return min(1.0, len(self.names) * float(erfc(largest / math.sqrt(2.0))))

    def direction(self, relative: Mapping[str, float]) -> Array:
        """(n_parameter,) direction of a cause in the coordinates of the difference."""
        units = {
            name: self.before[name] / _TYPICAL[name] for name in self.names if name in _TYPICAL
        }
        return np.array([relative.get(name, 0.0) * units.get(name, 1.0) for name in self.names])


def _change(now: Refit, before: Refit, differing: set[str]) -> _Change:
    """Comparable difference of two refits; `differing` are equations whose effects differ."""
    if "sensor" in differing:
        return _Change((), np.zeros(0), np.zeros((0, 0)), True, {})
    involved = set().union(*(_INVOLVED.get(equation, set()) for equation in differing))
    pairs = {
        name: (one, before.estimates[name])
        for name, one in now.estimates.items()
        if name in before.estimates and name not in involved
    } | {
        name: (one.estimate, before.sizes[name].estimate)
        for name, one in now.sizes.items()
        if name in before.sizes
        and one.meaning == before.sizes[name].meaning
        and now.equations.get(name.partition(".")[0]) not in differing
    }
    rows = {
        name: (new[0] - old[0], new[1], old[1])
        for name, (later, earlier) in pairs.items()
        if (new := _coordinate(name, later)) and (old := _coordinate(name, earlier))
    }
    names = tuple(rows)
    difference, new_sds, old_sds = (np.array(list(rows.values())).reshape(-1, 3)).T
    covariance = REPEATABILITY**2 * np.eye(len(names))
    for refit, sds in ((now, new_sds), (before, old_sds)):
        covariance += np.outer(sds, sds) * _correlation(refit, names)
    return _Change(
        names,
        difference,
        covariance,
        has_correlation=bool(now.correlation) and bool(before.correlation),
        before={name: pairs[name][1].median or 0.0 for name in names},
    )


def _coordinate(name: str, estimate: Estimate) -> tuple[float, float] | None:
    """Value and standard deviation of a parameter as compared; None if it is too imprecise."""
    if name in _TYPICAL:
        usable = estimate.usable
        pair = usable and (usable[0] / _TYPICAL[name], usable[1] / abs(_TYPICAL[name]))
    else:
        pair = estimate.logarithm
    return pair if pair and pair[1] < _WIDEST else None


def _correlation(refit: Refit, names: Sequence[str]) -> Array:
    """(n_parameter, n_parameter) correlation of a refit; zero between parameters if unknown.

    A coefficient that is compared relative to a negative one has the opposite sign.
    """
    signs = np.array([-1.0 if _TYPICAL.get(name, 1.0) < 0.0 else 1.0 for name in names])
    matrix = np.array([[refit.correlation.get((a, b), 0.0) for a in names] for b in names])
    # Rounded correlations close to one could otherwise make the matrix indefinite.
    matrix = 0.9999 * matrix.reshape(len(names), len(names)) * np.outer(signs, signs)
    np.fill_diagonal(matrix, 1.0)
    return matrix


def _probabilities(change: _Change) -> tuple[dict[str, float], dict[str, float]]:
    """Posterior probabilities of the causes, and the changes under the most probable one."""
    lower = np.linalg.cholesky(change.covariance)
    data = np.linalg.solve(lower, change.difference)
    logs = {NONE: math.log(_PRIOR_NONE), UNLISTED: math.log(_PRIOR_UNLISTED)}
    logs[UNLISTED] += _free_bayes_factor(change)
    best: dict[str, tuple[float, dict[str, float]]] = {}
    for cause in CAUSES:
        terms = []
        for declared in cause.directions(change.before):
            compared = {name: v for name, v in declared.items() if v and name in change.names}
            if not compared:
                continue
            # The prior of the size is that of the largest change, whatever is compared.
            largest = max(abs(v) for v in compared.values())
            relative = {name: v / largest for name, v in compared.items()}
            direction = np.linalg.solve(lower, change.direction(relative))
            strength = float(direction @ direction)
            size = float(direction @ data) / strength
            term = _ray_bayes_factor(size, strength)
            terms.append(term)
            if term >= best.get(cause.name, (-math.inf,))[0]:
                best[cause.name] = (term, {name: size * v for name, v in relative.items()})
        if terms:
            logs[cause.name] = _log_mean(terms) + math.log(
                (1.0 - _PRIOR_NONE - _PRIOR_UNLISTED) / len(CAUSES)
            )
    largest = max(logs.values())
    weights = {name: math.exp(value - largest) for name, value in logs.items()}
    total = sum(weights.values())
    ordered = sorted(weights, key=lambda name: -weights[name])
    return {n: weights[n] / total for n in ordered}, best.get(ordered[0], (0.0, {}))[1]


def _ray_bayes_factor(size: float, strength: float) -> float:
    """Log Bayes factor of a change of positive size along one direction against no change.

    The strength is the precision of the generalised least squares estimate of the size, u' C^-1 u.
    """
    from scipy.special import log_ndtr

    terms = []
    for scale in _SCALES:
        variance = 1.0 / (strength + scale**-2.0)
        mean = variance * strength * size
        sd = math.sqrt(variance)
        is_positive = float(log_ndtr(mean / sd))
        terms.append(math.log(2.0 * sd / scale) + mean**2 / (2.0 * variance) + is_positive)
    return _log_mean(terms)


def _free_bayes_factor(change: _Change) -> float:
    """Log Bayes factor of independent changes of all parameters against no change."""
    eigenvalues, vectors = np.linalg.eigh(change.covariance)
    squares = (vectors.T @ change.difference) ** 2
    logarithms = []
    for scale in _SCALES:
        wider = eigenvalues + scale**2
        terms = np.log(eigenvalues / wider) + squares * (1.0 / eigenvalues - 1.0 / wider)
        logarithms.append(0.5 * float(terms.sum()))
    return _log_mean(logarithms)


def _log_mean(logarithms: Sequence[float]) -> float:
    largest = max(logarithms)
    return largest + math.log(sum(math.exp(v - largest) for v in logarithms) / len(logarithms))
