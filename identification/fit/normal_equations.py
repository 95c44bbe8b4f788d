"""Gauss-Newton normal equations of the simulation error, with initial states eliminated.

With J and X the Jacobians of the whitened, weighted residual by the parameters and by the initial
state of one record,

    H = sum_records [ J'J - J'X (X'X + S^-1)^-1 X'J ] + prior

where S is the covariance of the prior of the initial state.  The prior keeps a state finite
that no sensor observes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.derivatives import Derivatives, gradient_of, products
from identification.fit.own_states import state_prior
from identification.linear import eigh, least_squares, solution
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator
from identification.model.weighting import Weighting

__all__ = ["NormalEquations", "normal_equations"]

_LARGEST = 1e100
"""Entry above which the simulation counts as diverged."""

_DIGITS: Final = 1e-3 / np.finfo(np.float64).eps
"""Information before the elimination of initial states over that after it, above which rounding
changes the latter by more than a thousandth: sensitivities grow exponentially where the substeps do
not resolve a sharp friction."""

_LEAST = 1e-60
"""Least entry of a diagonal, over the largest entry of the matrix."""
_PULLED: Final = 1e-6
"""Gradient, in standard deviations of its parameter alone, that releases it from its bound."""
_NO_RANGE: Final = 1e-12
"""Range of a search coordinate below which its parameter is fixed."""
_MOVES: Final = 5
"""Moves of the active-set method at most, for each parameter."""

_KEPT: Final = 100_000
"""Samples of all records up to which their sensitivities are cached; 8 MB for ten thousand."""


@dataclass(frozen=True)
class NormalEquations:
    """Gradient and Gauss-Newton matrix at one point, in search coordinates."""

    matrix: Array
    """(n_parameter, n_parameter) with initial states eliminated and the prior included."""
    information: Array
    """The same without the prior: the Fisher information of the data."""
    gradient: Array
    """(n_parameter,) negative gradient of the cost, initial states eliminated, prior included."""
    state_matrices: tuple[Array, ...]
    """For each record (n_state, n_state) X'X + S^-1."""
    couplings: tuple[Array, ...]
    """For each record (n_state, n_parameter) X'J."""
    state_gradients: tuple[Array, ...]
    """For each record (n_state,) negative gradient by the initial state."""
    logged: tuple[Array, ...]
    """For each record (n_sample, 2) simulated channels at this point [A, rad/s]."""
    derivatives: Derivatives
    """Sensitivities of the simulated channels by search coordinates and initial states."""

    @property
    def is_finite(self) -> bool:
        """True if a step can be computed: neither the simulation nor its sensitivities diverge."""
        return bool(np.isfinite(self.matrix).all() and np.isfinite(self.gradient).all())

    def decrement_within(self, position: Array, coordinates: Coordinates) -> float:
        """Predicted decrease of the cost by a full step within the bounds; about 1 by chance.

        The initial states follow the parameters; what they gain by themselves is the
        `state_decrement`.  If no step can be computed, the decrease is infinite.
        """
        if not self.is_finite:
            return np.inf
        step = self._step_within(0.0, position, coordinates, self.gradient)
        return float(self.gradient @ step - 0.5 * step @ self.matrix @ step)

    @property
    def state_decrement(self) -> float:
        """Predicted decrease of the cost if the initial states alone move to their optimum."""
        pairs = zip(self.state_matrices, self.state_gradients, strict=True)
        return sum(0.5 * float(right @ solution(matrix, right)) for matrix, right in pairs)

    def steps(
        self, dampings: Array, position: Array, coordinates: Coordinates
    ) -> tuple[Array, list[Array]]:
        """Levenberg-Marquardt steps from `position` inside the bounds.

        The dampings (n_lane,) are relative to the diagonal [-]; the steps of the parameters are
        (n_parameter, n_lane), those of the initial states (n_state, n_lane) for each record.
        """
        lanes = np.ones(dampings.size)
        own = [np.outer(gradient, lanes) for gradient in self.state_gradients]
        return self._solved(dampings, position, coordinates, np.outer(self.gradient, lanes), own)

    def curved(
        self,
        directions: Sequence[Array],
        changes: Sequence[Array],
        probe: float,
        weighting: Weighting,
    ) -> tuple[list[Array], Array]:
        """Second directional derivative of the simulation, projected on the sensitivities.

        For each record the directions are (n_parameter + n_state, n_lane) steps, the changes
        (n_sample, 2, n_lane) the channels simulated at the fraction `probe` of each step.  The
        projections are (n_parameter + n_state, n_lane) for each record; (n_lane,) says whether each
        is finite.
        """
        rights = [np.zeros(each.shape) for each in directions]
        finite = np.ones(directions[0].shape[1], dtype=bool)
        for block in self.derivatives.blocks(weighting.order):
            k, tangent = block.record, block.tangent
            rows, channels, size = tangent.shape
            slope = (tangent.reshape(rows * channels, size) @ directions[k]).reshape(
                rows, channels, -1
            )
            known = self.logged[k][block.samples, :, None]
            curve = 2.0 * (changes[k][block.samples] - known - probe * slope) / probe**2
            finite &= np.isfinite(curve[block.lead :]).all(axis=(0, 1))
            with np.errstate(invalid="ignore", over="ignore"):
                rights[k] += gradient_of(curve, tangent, weighting, k, block.start, block.lead)
        return rights, finite

    def bends(
        self, dampings: Array, position: Array, coordinates: Coordinates, curved: Sequence[Array]
    ) -> tuple[Array, list[Array]]:
        """Second-order corrections of `steps` along a curved valley (geodesic acceleration).

        `curved` is the second derivative along each step for each record.  The corrections have the
        shapes of the steps; they are zero if the second derivative is not finite.

        Source:
            Geodesic acceleration by Transtrum and Sethna, arXiv preprint 1201.5885 (2012).
        """
        n = position.size
        gradients, own = np.zeros((n, dampings.size)), []
        for k, each in enumerate(curved):
            right = -0.5 * each
            coupled = self.couplings[k].T @ solution(self.state_matrices[k], right[n:])
            gradients += right[:n] - coupled
            own.append(right[n:])
        return self._solved(dampings, position, coordinates, gradients, own)

    def _solved(
        self,
        dampings: Array,
        position: Array,
        coordinates: Coordinates,
        gradients: Array,
        state_gradients: Sequence[Array],
    ) -> tuple[Array, list[Array]]:
        steps, moves = np.zeros_like(gradients), [np.zeros_like(g) for g in state_gradients]
        for lane in np.flatnonzero(np.isfinite(gradients).all(axis=0)):
            step = self._step_within(dampings[lane], position, coordinates, gradients[:, lane])
            steps[:, lane] = step
            for k, right in enumerate(state_gradients):
                own = right[:, lane] - self.couplings[k] @ step
                moves[k][:, lane] = solution(self.state_matrices[k], own)
        return steps, moves

    def _step_within(
        self, damping: float, position: Array, coordinates: Coordinates, gradient: Array
    ) -> Array:
        """(n_parameter,) step that minimises the damped quadratic model within the bounds.

        An active-set method: each move to the minimum over the free parameters ends at the first
        bound, whose parameter then stays there; one that the remaining gradient pulls inside is
        released.
        """
        damped = self.matrix + damping * np.diag(np.diag(self.matrix))
        least, most = coordinates.lower - position, coordinates.upper - position
        size, step = _sizes(damped), np.zeros(position.size)
        free = np.ones(position.size, dtype=bool)
        for _ in range(_MOVES * position.size):
            move = np.zeros(position.size)
            move[free] = _solved(damped[np.ix_(free, free)], (gradient - damped @ step)[free])
            target = np.where(move < 0, least, most)
            beyond = (move != 0) & (np.abs(move) > np.abs(target - step))
            if beyond.any():
                shares = np.where(beyond, (target - step) / np.where(beyond, move, 1.0), 1.0)
                first = shares <= shares.min()
                step = np.where(first, target, step + shares.min() * move)
                free &= ~first
                continue
            step += move
            pull = (gradient - damped @ step) / size
            stays = free | (most - least < _NO_RANGE)
            inside = np.where(stays, 0.0, np.where(step <= least, pull, -pull))
            if not inside.max(initial=0.0) > _PULLED:
                break
            free[int(np.argmax(inside))] = True
        return np.clip(step, least, most)

    def covariance(self, fraction: float = 1.0) -> Array:
        """Covariance of the search coordinates, prior included.

        The sample fraction scales the data; the prior keeps its weight.
        """
        return _inverse(self.precision(fraction))

    def precision(self, fraction: float) -> Array:
        """Inverse of `covariance`, (n_parameter, n_parameter)."""
        return np.asarray(self.matrix - (1.0 - fraction) * self.information)

    def state_response(self, k: int) -> Array:
        """(n_state, n_parameter) derivative of the best initial state of record `k`."""
        return -solution(self.state_matrices[k], self.couplings[k])


def normal_equations(
    simulator: Simulator,
    coordinates: Coordinates,
    position: Array,
    states: Sequence[Array],
    weighting: Weighting,
) -> NormalEquations:
    """Normal equations at a position (n_parameter,) and an initial state (n_state,) of each record.

    The coordinates have the priors, the noise model its standard deviations.
    """
    n = position.size
    directions = np.diag(coordinates.slopes(position))
    derivatives = Derivatives(simulator, coordinates.values(position), tuple(states), directions)
    if sum(record.rows for record in simulator.records) <= _KEPT:
        derivatives = derivatives.keeping()
    fulls, rights, logged = _summed(derivatives, weighting, n + simulator.n_state)
    information, gradient, whole = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    matrices, couplings, state_gradients = [], [], []
    for k, (full, right) in enumerate(zip(fulls, rights, strict=True)):
        precision, pull = state_prior(simulator, k)
        xx = full[n:, n:] + precision
        xg = right[n:] + pull - precision @ states[k]
        xj = full[n:, :n]
        if not np.max(np.abs(full)) < _LARGEST:
            # The simulation diverges: `is_finite` becomes False, and no step is computed.
            information[:], xx, xj = np.nan, np.eye(xx.shape[0]), np.zeros_like(xj)
        solved = solution(xx, np.column_stack([xj, xg]))
        whole += np.diag(full)[:n]
        information += full[:n, :n] - xj.T @ solved[:, :n]
        gradient += right[:n] - xj.T @ solved[:, n]
        matrices.append(xx)
        couplings.append(xj)
        state_gradients.append(xg)
    prior = 1.0 / coordinates.prior_sd**2
    if np.any(whole > _DIGITS * np.maximum(np.diag(information) + prior, 0.0)):
        information[:] = np.nan
    matrix = information + np.diag(prior)
    gradient = gradient + prior * np.where(prior > 0, coordinates.prior_mean - position, 0.0)
    return NormalEquations(
        matrix,
        information,
        gradient,
        tuple(matrices),
        tuple(couplings),
        tuple(state_gradients),
        tuple(logged),
        derivatives,
    )


def _summed(
    derivatives: Derivatives, weighting: Weighting, size: int
) -> tuple[list[Array], list[Array], list[Array]]:
    """For each record (size, size) and (size,) sums over its blocks, and its readings."""
    records = derivatives.simulator.records
    fulls = [np.zeros((size, size)) for _ in records]
    rights = [np.zeros(size) for _ in records]
    logged = [np.empty((record.rows, 2)) for record in records]
    for block in derivatives.blocks(weighting.order):
        k, samples = block.record, block.samples
        residual = records[k].measured[samples] - block.logged
        full, right = products(residual, block.tangent, weighting, k, block.start, block.lead)
        fulls[k] += full
        rights[k] += right
        logged[k][samples] = block.logged
    return fulls, rights, logged


def _solved(matrix: Array, right: Array) -> Array:
    """Solution of a symmetric system, scaled to unit diagonal; least squares if singular."""
    if matrix.size == 0:
        return right
    size = _sizes(matrix)
    scaled = matrix / np.outer(size, size)
    return least_squares(scaled, right / size, 1e-13) / size


def _sizes(matrix: Array) -> Array:
    """Square roots of the diagonal; rounding may leave zero or less where it is undetermined."""
    least = max(_LEAST * float(np.max(np.abs(matrix), initial=0.0)), 1e-300)
    return np.asarray(np.sqrt(np.maximum(np.diag(matrix), least)))


def _inverse(matrix: Array) -> Array:
    size = _sizes(matrix)
    scaled = matrix / np.outer(size, size)
    values, vectors = eigh(scaled)
    values = np.maximum(values, 1e-14)
    return np.asarray((vectors / values) @ vectors.T / np.outer(size, size))
