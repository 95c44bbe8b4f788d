"""Kalman filter and smoother, compared with the dense normal distribution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.diagnosis import smoothing
from identification.diagnosis.deviation import Deviation, Piece, Structure
from identification.diagnosis.filtering import likelihood
from identification.diagnosis.smoothing import auxiliary_residuals, smoothed_disturbances
from identification.model.excitation import records_of
from tests.motors import motor_named, noiseless

Array = NDArray[np.float64]

ROWS = 25
A = np.array([[0.3, -0.2], [0.1, 0.9]])
B = np.array([[0.8, 0.05], [0.1, 0.4]])
HYPER = np.array([0.8, 0.3, 0.95, 0.05, 0.6, 0.2, 0.7, 0.1, 0.5, 0.4, 0.02])


def system(seed: int = 1) -> Deviation:
    """Artificial motor with two states, two parameters and two records of 25 rows."""
    rng = np.random.default_rng(seed)
    stacked = np.concatenate([A, B, np.eye(2)], axis=1)
    fixed = tuple(float(v) for v in stacked.T.ravel())
    record = records_of(noiseless(motor_named("servo 100 W"), seed=1, runs=1, rows=ROWS))[0]
    pieces = []
    for _ in range(2):
        weight = rng.uniform(0.3, 2.0, (ROWS, 2))
        weight[7, 0] = 0.0
        targets = rng.standard_normal((ROWS, 2, 3))
        pieces.append(Piece(record, np.zeros((ROWS, 0)), targets, weight, np.array([2.0, 3.0])))
    return Deviation(
        Structure(2, fixed, 2),
        tuple(pieces),
        np.ones(2),
        np.array([2.0, 0.5]),
        1e-3,
        np.array([0.5, 2.0]),
        np.array([0.3, -0.2]),
    )


def dense(piece: Piece, hyper: Array) -> tuple[Array, Array, Array]:
    """Covariances of stacked residuals and disturbances, computed by plain recursion."""
    n = 6
    f = np.zeros((n, n))
    f[:2, :2], f[:2, 2:4] = A, B
    f[range(2, 6), range(2, 6)] = hyper[0:8:2]
    q = np.zeros((n, n))
    q[:2, :2] = hyper[10] * np.outer(B[:, 0], B[:, 0])
    q[range(2, 6), range(2, 6)] = hyper[1:8:2]
    h = np.zeros((2, n))
    h[:, :2], h[0, 4], h[1, 5] = np.eye(2), 1.0, 1.0
    start = np.diag(np.concatenate([piece.spread, hyper[1:8:2] / (1 - hyper[0:8:2] ** 2)]))
    whole = np.zeros((ROWS * n, ROWS * n))
    spread = start
    for row in range(ROWS):
        cross = spread.copy()
        for later in range(row, ROWS):
            block = slice(later * n, later * n + n), slice(row * n, row * n + n)
            whole[block] = cross
            whole[block[::-1]] = cross.T
            cross = f @ cross
        spread = f @ spread @ f.T + q
    see = np.kron(np.eye(ROWS), h)
    pick = np.kron(np.eye(ROWS), np.eye(n)[2:4])
    with np.errstate(divide="ignore"):
        white = np.where(piece.weight > 0, hyper[8:10] / piece.weight, 1e9).ravel()
    return see @ whole @ see.T + np.diag(white), pick @ whole @ pick.T, pick @ whole @ see.T


def dense_fit(deviation: Deviation, hyper: Array) -> tuple[float, Array, Array]:
    """Log likelihood up to a constant, and mean and covariance of the parameters."""
    matrix = np.diag(deviation.precision)
    right = deviation.precision * deviation.offset
    constant = float(deviation.precision @ deviation.offset**2)
    for piece in deviation.pieces:
        covariance = dense(piece, hyper)[0]
        targets = piece.targets.reshape(-1, 3)
        solved = np.linalg.solve(covariance, targets)
        constant += float(targets[:, 0] @ solved[:, 0]) + np.linalg.slogdet(covariance)[1]
        matrix = matrix + targets[:, 1:].T @ solved[:, 1:]
        right = right + targets[:, 1:].T @ solved[:, 0]
    best = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    value = -0.5 * (constant - right @ best + np.linalg.slogdet(matrix)[1])
    return float(value), best, np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def test_the_likelihood_is_that_of_the_dense_normal_law() -> None:
    """Likelihood differences and parameters agree with a solution by 100 x 100 matrices."""
    deviation, other = system(), HYPER * np.array([1, 3, 0.9, 0.2, 1, 2, 0.5, 1, 1.5, 0.7, 4.0])

    found = likelihood(deviation, deviation.pieces, np.column_stack([HYPER, other]))

    value, best, covariance = dense_fit(deviation, HYPER)
    # The dense solution represents a masked sample by a variance of 1e9.
    expected = dense_fit(deviation, other)[0] - value
    assert found.value[1] - found.value[0] == pytest.approx(expected, abs=1e-5)
    np.testing.assert_allclose(found.shift[0], best, rtol=1e-6)
    np.testing.assert_allclose(found.covariance[0], covariance, rtol=1e-6)


@pytest.mark.parametrize("rows", [7, 50_000])
def test_the_traces_are_mean_and_deviation_of_the_dense_posterior(
    rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reference: conditional normal distribution of the disturbances, with uncertain parameters.

    The result must not depend on whether a record is filtered at once or in blocks of seven rows.
    """
    monkeypatch.setattr(smoothing, "_AT_ONCE", rows)
    deviation = system(2)
    known = likelihood(deviation, deviation.pieces, HYPER[:, None])

    found = smoothed_disturbances(deviation, HYPER[:, None], known)

    _, best, covariance = dense_fit(deviation, HYPER)
    for trace, piece in zip(found, deviation.pieces, strict=True):
        own, prior, cross = dense(piece, HYPER)
        targets = piece.targets.reshape(-1, 3)
        gain = np.linalg.solve(own, cross.T).T
        mean = gain @ (targets[:, 0] - targets[:, 1:] @ best)
        moved = gain @ targets[:, 1:]
        spread = prior - gain @ cross.T + moved @ covariance @ moved.T
        deviations = np.sqrt(np.diag(spread)).reshape(-1, 2)
        np.testing.assert_allclose(trace[:, :2], mean.reshape(-1, 2) * deviation.scale, rtol=1e-5)
        np.testing.assert_allclose(trace[:, 2:], deviations * deviation.scale, rtol=1e-5)


def test_surprises_are_leave_one_out_residuals() -> None:
    """Reference: leave-one-out residual over its standard deviation, from the dense inverse."""
    deviation = system(3)
    pieces = [replace(piece, weight=np.ones((ROWS, 2))) for piece in deviation.pieces]
    deviation = replace(deviation, pieces=tuple(pieces))
    known = likelihood(deviation, pieces, HYPER[:, None])

    found = auxiliary_residuals(deviation, pieces, HYPER[:, None], known)

    targets = pieces[0].targets.reshape(-1, 3)
    inverse = np.linalg.inv(dense(pieces[0], HYPER)[0])
    alone = inverse @ (targets[:, 0] - targets[:, 1:] @ known.shift[0])
    expected = (alone / np.sqrt(np.diag(inverse))).reshape(-1, 2)
    np.testing.assert_allclose(found[0], expected, rtol=1e-6)
