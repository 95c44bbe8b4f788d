"""Fixed-interval smoothing (RTS, adjoint form) of the missing voltage and torque.

The Kalman filter estimates each sample from the past only.  A backward pass adds the future as the
adjoint of the innovations, so that no covariance is inverted (it would be singular if the motor's
state decays within one sample interval):

    lambda <- F' lambda;   for each channel, last first:
    lambda <- C' v / s + (1 - K C)' lambda,      Lambda <- C' C / s + (1 - K C)' Lambda (1 - K C)
    smoothed = m + P lambda,                     variance = P - P Lambda P

The uncertainty of the parameters widens the bands.  Residual and parameter tangents are lanes of
the same two passes, so the parameter variance is added exactly.

Source: Rauch et al., AIAA J. 3 (1965) 1445-1450; in this form (modified Bryson-Frazier) Bierman,
Automatica 9 (1973) 503-511.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.diagnosis.deviation import Deviation, Piece, Structure
from identification.diagnosis.filtering import (
    HYPER,
    Likelihood,
    Symbols,
    predicted,
    rows_of,
    started,
    updated,
)
from identification.model.scan import scan_of

__all__ = ["auxiliary_residuals", "smoothed_disturbances"]

_AT_ONCE: Final = 4_000
"""Rows whose covariances are held in memory together.  A longer piece is filtered twice: the second
pass takes the blocks in reverse order and starts each from the state stored by the first pass."""


def auxiliary_residuals(
    deviation: Deviation, pieces: Sequence[Piece], hyper: Array, known: Likelihood
) -> list[Array]:
    """For each piece (n_sample, 2) standardised auxiliary residuals.

    An auxiliary residual is the difference of a sample from its prediction by all other samples.  A
    sensor outlier is far from both its past and its future, a jump of the motor from only one of
    them.  Innovations, which use the past only, would confuse the two.  The arguments are those of
    `smoothed_disturbances`.

    Source:
        Harvey, Koopman, J. Business & Economic Statistics 10 (1992) 377-389 (auxiliary residuals).
    """
    return _passes(deviation, pieces, hyper, known, _auxiliary_residual)


def smoothed_disturbances(deviation: Deviation, hyper: Array, known: Likelihood) -> list[Array]:
    """For each record (n_sample, 4) missing voltage and torque, and their standard deviations.

    `hyper` (n_hyper, 1) holds the hyperparameters, see `HYPER`, `known` the posterior of the
    parameters under them.
    """

    def smoothed(out: Array) -> Array:
        return _smoothed(deviation, out, known.covariance[0])

    return _passes(deviation, deviation.pieces, hyper, known, smoothed)


def _batches(pieces: Sequence[Piece]) -> Iterator[list[Piece]]:
    batch: list[Piece] = []
    for piece in pieces:
        if batch and sum(p.rows for p in batch) + piece.rows > _AT_ONCE:
            yield batch
            batch = []
        batch.append(piece)
    if batch:
        yield batch


def _passes(
    deviation: Deviation,
    pieces: Sequence[Piece],
    hyper: Array,
    known: Likelihood,
    kept: Callable[[Array], Array],
) -> list[Array]:
    """For each piece `kept` applied to the output (n_sample, 8, n_column) of `_backward`."""
    batches = list(_batches(pieces))
    if len(batches) > 1:
        return [x for own in batches for x in _passes(deviation, own, hyper, known, kept)]
    structure = deviation.structure
    symbols, columns = Symbols(structure), 1 + structure.tangents
    parameters = np.concatenate([np.repeat(hyper, columns, axis=1), np.eye(columns)])
    forward, backward = (scan_of(f(structure), effort="some") for f in (_forward, _backward))
    size = len(symbols.triangle)
    packed = [started(deviation, piece, hyper) for piece in pieces]
    means = np.zeros((symbols.size, columns))
    starts = [[np.concatenate([np.repeat(p, columns, axis=1), means]) for p in packed]]
    firsts = range(0, max(piece.rows for piece in pieces), _AT_ONCE)
    for first in firsts[:-1]:
        rows = [_rows(piece, first, known) for piece in pieces]
        starts.append(forward(rows, parameters, starts[-1])[0])
    ends = [np.zeros((size + symbols.size, columns)) for _ in pieces]
    found = []
    for first, start in zip(reversed(firsts), reversed(starts), strict=True):
        rows = [_rows(piece, first, known) for piece in pieces]
        back = []
        for row, out in zip(rows, forward(rows, parameters, start)[1], strict=True):
            means = out[:, size:, :].transpose(0, 2, 1).reshape(out.shape[0], -1)
            back.append(np.column_stack([row, out[:, :size, 0], means])[::-1])
        ends, outputs = backward(back, parameters, ends)
        found.append([kept(out[::-1]) for out in outputs])
    return [np.concatenate(blocks) for blocks in zip(*reversed(found), strict=True)]


def _rows(piece: Piece, first: int, known: Likelihood) -> Array:
    """Input rows of both passes for a block of samples, at the posterior mean of the parameters."""
    part = piece.part(first, first + _AT_ONCE)
    targets = part.targets.copy()
    targets[:, :, 0] -= targets[:, :, 1:] @ known.shift[0]
    return rows_of(replace(part, targets=targets))


def _auxiliary_residual(out: Array) -> Array:
    """(n_sample, 2) standardised auxiliary residuals from the output of `_backward`."""
    return np.asarray(out[:, 4:6, 0] / np.sqrt(np.maximum(out[:, 6:8, 0], 1e-300)))


def _smoothed(deviation: Deviation, out: Array, covariance: Array) -> Array:
    """(n_sample, 4) missing terms and their standard deviations from the output of `_backward`."""
    response = out[:, :2, 1:]
    moved = np.einsum("ncj,jk,nck->nc", response, covariance, response, optimize=True)
    variance = np.maximum(out[:, 2:4, 0], 0.0) + moved
    return np.hstack([out[:, :2, 0] * deviation.scale, np.sqrt(variance) * deviation.scale])


def _forward(structure: Structure) -> ca.Function:
    """Kalman filter step of one column per lane; the output is the a priori covariance and mean."""
    symbols = Symbols(structure)
    entries, targets, weight, lane = symbols.row(1 + structure.tangents)
    packed, mean = ca.SX.sym("P", len(symbols.triangle)), ca.SX.sym("m", symbols.size)
    covariance, after = symbols.full(packed), mean
    target = ca.mtimes(targets, lane[len(HYPER) :])
    for channel, seen in enumerate(symbols.seen(entries)):
        after, covariance, _, _ = updated(
            seen, after, covariance, target[channel], weight[channel], lane[8 + channel]
        )
    following, spread = predicted(symbols, after, covariance, entries, lane)
    before = ca.vertcat(packed, mean)
    return ca.Function(
        "forward",
        [before, ca.vertcat(entries, ca.vec(targets), weight), lane],
        [ca.vertcat(symbols.packed(spread), following), before],
    )


def _backward(structure: Structure) -> ca.Function:
    """Adjoint recursion over one row, backward in time.

    The output is mean and variance of e (two each), then the auxiliary residuals of both channels,
    then their variances.
    """
    symbols = Symbols(structure)
    entries, targets, weight, lane = symbols.row(1 + structure.tangents)
    size, n, picked = symbols.size, structure.shape, lane[len(HYPER) :]
    packed = ca.SX.sym("P", len(symbols.triangle))
    means = ca.SX.sym("m", size, 1 + structure.tangents)
    future, adjoint = ca.SX.sym("L", len(symbols.triangle)), ca.SX.sym("l", size)
    before, start = symbols.full(packed), ca.mtimes(means, picked)
    seen, target = symbols.seen(entries), ca.mtimes(targets, picked)
    mean, covariance, passed = start, before, []
    for channel, c in enumerate(seen):
        gain = ca.mtimes(covariance, c.T)
        mean, covariance, innovation, inverse = updated(
            c, mean, covariance, target[channel], weight[channel], lane[8 + channel]
        )
        passed.append((c, gain * inverse, innovation, inverse))
    f = symbols.transition(entries, lane)
    value = ca.mtimes(f.T, adjoint)
    matrix = symbols.symmetric(ca.mtimes(ca.mtimes(f.T, symbols.full(future)), f))
    auxiliary: list[ca.SX] = []
    spread: list[ca.SX] = []
    for c, gain, innovation, inverse in reversed(passed):
        auxiliary.insert(0, innovation * inverse - ca.mtimes(gain.T, value))
        spread.insert(0, inverse + ca.mtimes(ca.mtimes(gain.T, matrix), gain))
        keep = ca.SX.eye(size) - ca.mtimes(gain, c)
        value = c.T * (innovation * inverse) + ca.mtimes(keep.T, value)
        turned = ca.mtimes(ca.mtimes(keep.T, matrix), keep)
        matrix = symbols.symmetric(turned + ca.mtimes(c.T, c) * inverse)
    own = before[n : n + 2, :]
    smoothed = start[n : n + 2] + ca.mtimes(own, value)
    taken = ca.mtimes(own, matrix)
    variance = [before[n + k, n + k] - ca.mtimes(taken[k, :], own[k, :].T) for k in range(2)]
    return ca.Function(
        "backward",
        [
            ca.vertcat(future, adjoint),
            ca.vertcat(entries, ca.vec(targets), weight, packed, ca.vec(means)),
            lane,
        ],
        [
            ca.vertcat(symbols.packed(matrix), value),
            ca.vertcat(smoothed, *variance, *auxiliary, *spread),
        ],
    )
