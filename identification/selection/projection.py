"""Projection of deviations and residual on the complement of the fitted parameters.

Let d be the deviation of a prototype from the current model, r the residual and W the weights.
Everything that the fitted parameters and initial states can reproduce is removed from d:

    gain = (d_perp' W r)^2 / (2 d_perp' W d_perp)               [log likelihood]

The plain correlation of d with r would mislead, because the parameters fitted without the effect
have absorbed part of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.derivatives import gradient_of
from identification.fit.solve import Fit
from identification.linear import eigh, least_squares, solution
from identification.model.excitation import Record
from identification.selection.start import Along
from identification.work import TOUCH, charge

__all__ = ["Projection", "Residual", "gains_of", "group_products"]

_PASSES: Final = 6.0
"""Memory passes of a product over each deviation, for the operation count."""
_COLLINEAR: Final = 1e-8
"""Fraction of a deviation's square that remains of a deviation that is collinear with others."""

_UNFAIR: Final = 0.5
"""Least deviation of the compared weight from its share, if stride and period have a factor [-]:
the compared weight is then zero, or twice the share at least."""


@dataclass(frozen=True)
class Projection:
    """Projected products of deviations with the residual and with each other."""

    onto_residual: Array
    """(n_lane,) d_perp' W r; NaN for a deviation that is not finite."""
    products: Array
    """(n_lane, n_lane) d_perp' W d_perp."""
    along: Along
    """First-order change of the fit that accompanies each deviation."""

    def of(self, lanes: slice) -> Projection:
        """Selected lanes."""
        own = self.products[lanes, lanes]
        return Projection(self.onto_residual[lanes], own, self.along.of(lanes))

    def gain(self) -> tuple[float, Array]:
        """Gain of all lanes together and their optimal amplitudes; see `gains_of`."""
        gains, weights = self.group_gains(self.onto_residual.size)
        return float(gains[0]), weights[0]

    def group_gains(self, size: int) -> tuple[Array, Array]:
        """Gain of each group of `size` consecutive lanes, (n_group,), and its optimal amplitudes.

        The amplitudes are (n_group, size); see `gains_of`.
        """
        return gains_of(group_products(self.products, size), self.onto_residual.reshape(-1, size))

    def conditional_gains(self, chosen: Sequence[int]) -> Array:
        """(n_lane,) gain of each lane, at its amplitude given the sum of the `chosen` lanes.

        The amplitudes of the lane and of that sum are fitted together; the gain is that of a lane
        of this amplitude alone.  It is small if the chosen lanes explain what the lane explains
        without them.  A lane that is collinear with their sum keeps its own amplitude, because no
        data separate the two.
        """
        size, shared = np.diag(self.products), self.products[:, chosen].sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = shared / shared[chosen].sum()
            left = size - shared * share
            is_separable = left > _COLLINEAR * size
            left = np.where(is_separable, left, size)
            right = self.onto_residual - share * self.onto_residual[chosen].sum()
            right = np.where(is_separable, right, self.onto_residual)
            return np.asarray(0.5 * size * (right / left) ** 2)

    def covariance(self) -> Array:
        """(n_lane, n_lane) covariance of the amplitudes."""
        return np.asarray(np.linalg.pinv(self.products, rcond=_COLLINEAR, hermitian=True))


def group_products(products: Array, size: int) -> Array:
    """Blocks (n_group, size, size) on the diagonal of products (n_lane, n_lane)."""
    groups = products.shape[0] // size
    own = np.arange(groups)
    return products.reshape(groups, size, groups, size)[own, :, own, :]


def gains_of(squares: Array, rights: Array) -> tuple[Array, Array]:
    """Gains of the log likelihood at the optimal amplitudes, (n,), and these amplitudes, (n, m).

    The normal matrices are (n, m, m), the right-hand sides (n, m).  An undefined gain is NaN; its
    amplitudes are the right-hand side.
    """
    size = np.sqrt(np.maximum(np.diagonal(squares, axis1=1, axis2=2), 0.0))
    is_defined = np.isfinite(squares).all(axis=(1, 2)) & np.isfinite(rights).all(axis=1)
    is_defined &= (size > 0).all(axis=1)
    size[~is_defined] = 1.0
    scaled = squares / (size[:, :, None] * size[:, None, :])
    scaled[~is_defined] = np.eye(rights.shape[1])
    values, vectors = eigh(scaled)
    inverse = np.zeros_like(values)
    np.divide(1.0, values, out=inverse, where=values > _COLLINEAR * values[:, -1:])
    along = inverse * np.einsum("nij,ni->nj", vectors, rights / size)
    weights = np.einsum("nij,nj->ni", vectors, along) / size
    weights[~is_defined] = rights[~is_defined]
    gains = np.where(is_defined, 0.5 * np.einsum("ni,ni->n", weights, rights), np.nan)
    return gains, weights


@dataclass(frozen=True)
class _Compared:
    """Whitened residual and sensitivities of the compared samples of a record, for each channel."""

    weights: Array
    """(2, n_compared) sample weights over the variance of the noise [1/A^2, s^2/rad^2]."""
    residual: Array
    """(2, n_compared) measured minus fitted [A, rad/s]."""
    tangents: tuple[Array, Array]
    """(n_compared, n_direction) each."""
    asked: Array
    """(n_direction,) gradient of the compared samples minus that of all samples."""


@dataclass(frozen=True)
class Residual:
    """Residual of a fit, with which deviations are compared."""

    fit: Fit
    """The fit; its simulator may use fewer substeps than the fit did."""
    series: tuple[Array, ...]
    """For each record (n_sample, 2) measured minus fitted [A, rad/s]."""
    stride: int
    """Samples per compared sample; 1 if the noise is whitened."""

    @classmethod
    def of(cls, fit: Fit, samples: int) -> Residual:
        """Residual of a fit, compared at `samples` samples of each channel at least."""
        records = fit.simulator.records
        is_whitened = any(len(taps) > 1 for taps in fit.weighting.whitening)
        stride = 1 if is_whitened else _stride(records, samples)
        pairs = zip(records, fit.equations.logged, strict=True)
        return cls(fit, tuple(record.measured - logged for record, logged in pairs), stride)

    @cached_property
    def _compared(self) -> list[_Compared]:
        """For each record what every deviation is multiplied with."""
        weighting, stride = self.fit.weighting, self.stride
        found = []
        blocks = self.fit.equations.derivatives.blocks(0)
        for residual, block in zip(self.series, blocks, strict=True):
            tangents = (
                weighting.whitened(block.tangent[::stride, 0, :], 0),
                weighting.whitened(block.tangent[::stride, 1, :], 1),
            )
            white = weighting.both_whitened(residual[::stride]).T
            scale = stride / weighting.deviation[:, None] ** 2
            weights = scale * weighting.sample_weights(block.record)[::stride].T
            asked = -gradient_of(residual, block.tangent, weighting, block.record)
            for tangent, weight, own in zip(tangents, weights, white, strict=True):
                asked += tangent.T @ (weight * own)
            found.append(_Compared(weights, white, tangents, asked))
        return found

    def products(self, k: int, deviation: Array) -> tuple[Array, Array, Array]:
        """Products of deviations of record `k`, (n_compared, 2, n_lane), before the projection.

        Returns:
            d' W d (n_lane, n_lane), d' W r (n_lane,), and the products with the sensitivities
            (n_direction, n_lane).
        """
        charge(_PASSES * TOUCH * deviation.size)
        compared, lanes = self._compared[k], deviation.shape[2]
        square, right = np.zeros((lanes, lanes)), np.zeros(lanes)
        crossed = np.zeros((compared.asked.size, lanes))
        for channel in range(2):
            white = self.fit.weighting.whitened(deviation[:, channel, :], channel)
            scaled = white * compared.weights[channel, :, None]
            square += white.T @ scaled
            right += scaled.T @ compared.residual[channel]
            crossed += compared.tangents[channel].T @ scaled
        return square, right, crossed

    def project(self, deviations: Iterable[Array], lanes: int) -> Projection:
        """Project deviations, (n_compared, 2, n_lane) for each record.

        At a bound, or short of the optimum, d' W r contains gain that the parameters can still
        achieve by themselves.  This gain is subtracted.  The same holds if the compared samples
        have another optimum than all samples.
        """
        equations, n = self.fit.equations, self.fit.position.size
        gradient = equations.gradient.copy()
        right = np.zeros(lanes)
        square = np.zeros((lanes, lanes))
        crossed = np.zeros((n, lanes))
        moved = []
        for k, (deviation, compared) in enumerate(zip(deviations, self._compared, strict=True)):
            bad = np.asarray(~np.isfinite(deviation).all(axis=(0, 1)))
            safe = np.where(bad[None, None, :], 0.0, deviation)
            own_square, own_right, both = self.products(k, safe)
            asked, matrix, coupling = (
                compared.asked, equations.state_matrices[k], equations.couplings[k]
            )  # fmt: skip
            solved = solution(matrix, both[n:])
            square += own_square - both[n:].T @ solved
            right += own_right - solved.T @ (equations.state_gradients[k] + asked[n:])
            gradient += asked[:n] - coupling.T @ solution(matrix, asked[n:])
            moved.append(solved)
            crossed += both[:n] - coupling.T @ solved
            right[bad] = np.nan
        size = np.sqrt(np.diag(equations.matrix))
        scaled_matrix = equations.matrix / np.outer(size, size)
        solved = least_squares(scaled_matrix, crossed / size[:, None], 1e-12)
        moves = -solved / size[:, None]
        right += moves.T @ gradient
        states = self._state_moves(moves, moved)
        products = square - (crossed / size[:, None]).T @ solved
        return Projection(right, products, Along(moves, states))

    def _state_moves(self, moves: Array, moved: Sequence[Array]) -> tuple[Array, ...]:
        """For each record (n_state, n_lane) first-order change of the initial state."""
        equations = self.fit.equations
        both = zip(moved, equations.state_matrices, equations.couplings, strict=True)
        return tuple(-own - solution(matrix, coupling @ moves) for own, matrix, coupling in both)


def _stride(records: Sequence[Record], samples: int) -> int:
    """Largest stride that compares `samples` samples of each channel, in proportion to its weight.

    The weights of a held channel are periodic: a stride that shares a factor with the period meets
    none of its samples, or a multiple of their share.
    """
    total = sum(record.weight.sum(axis=0) for record in records)
    fewest = int(np.min(total, where=total > 0.0, initial=sum(r.rows for r in records)))
    for stride in range(fewest // samples, 1, -1):
        compared = stride * sum(record.weight[::stride].sum(axis=0) for record in records)
        if np.all(np.abs(compared - total) <= _UNFAIR * total):
            return stride
    return 1
