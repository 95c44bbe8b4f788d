"""Linear algebra that returns NaN where no solution exists."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.linear import eigenvalues, eigh, least_squares, root, solution

Array = NDArray[np.float64]

NAN = np.array([[1.0, np.nan], [np.nan, 1.0]])
INFINITE = np.array([[np.inf, 0.0], [0.0, 1.0]])
SINGULAR = np.ones((2, 2))


@pytest.mark.parametrize("matrix", [NAN, INFINITE])
def test_operations_on_matrices_that_are_not_finite_give_nan(matrix: Array) -> None:
    """For some of these, numpy raises LinAlgError, depending on the version of LAPACK."""
    assert np.isnan(solution(matrix, np.ones(2))).all()
    assert np.isnan(least_squares(matrix, np.ones((2, 3)))).all()
    assert np.isnan(eigh(matrix)[0]).all()
    assert np.isnan(eigenvalues(matrix)).all()
    assert np.isnan(root(matrix)).all()


def test_a_singular_system_has_no_solution_and_one_of_least_norm() -> None:
    """Twice x + y = 2 has infinitely many solutions; (1, 1) has the least norm."""
    assert np.isnan(solution(SINGULAR, np.array([2.0, 2.0]))).all()
    assert least_squares(SINGULAR, np.array([2.0, 2.0])) == pytest.approx([1.0, 1.0])


def test_a_covariance_of_rank_one_has_a_root() -> None:
    """Cholesky's method fails for eigenvalues 0 and 2; A A' still equals the matrix."""
    found = root(SINGULAR)

    assert found @ found.T == pytest.approx(SINGULAR)


def test_one_matrix_that_is_not_finite_leaves_the_others_their_eigenvalues() -> None:
    """The other matrix of the batch is the identity, whose eigenvalues are 1."""
    found = eigenvalues(np.stack([NAN, np.eye(2)]))

    assert np.isnan(found[0]).all()
    assert found[1] == pytest.approx([1.0, 1.0])
