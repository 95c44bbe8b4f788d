"""Draws of the parameters of a result without a posterior."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from identification.quantities import DECLARED_PARAMETERS
from identification.result.draws import normal_draws


def result(correlation: dict[str, Any] | None) -> dict[str, Any]:
    """A result whose parameters are all known to 1 %."""
    entry = {"median": 2.0, "sd": 0.02}
    found: dict[str, Any] = {"parameters": dict.fromkeys(DECLARED_PARAMETERS, entry)}
    return found if correlation is None else found | {"correlation": correlation}


def correlation(value: float, first: str, second: str) -> dict[str, Any]:
    """Member `correlation` in which two parameters are correlated."""
    names = ["coulomb_friction.torque", *DECLARED_PARAMETERS]
    matrix: Any = np.eye(len(names))
    k, m = names.index(first), names.index(second)
    matrix[k, m] = matrix[m, k] = value
    matrix = matrix.tolist()
    matrix[0] = [None] * len(names)
    for row in matrix:
        row[0] = None
    return {"names": names, "matrix": json.loads(json.dumps(matrix))}


@pytest.mark.parametrize("value", [-0.9, 0.5, 0.999])
def test_draws_have_the_correlation_of_the_result(value: float) -> None:
    """4000 draws estimate a correlation r to (1 - r^2) / sqrt(4000), at most 1.2 %."""
    drawn = normal_draws(result(correlation(value, "J", "b")), 4000)
    assert np.corrcoef(drawn["J"], drawn["b"])[0, 1] == pytest.approx(value, abs=0.05)
    assert np.corrcoef(drawn["J"], drawn["L"])[0, 1] == pytest.approx(0.0, abs=0.05)
    assert np.std(drawn["b"]) == pytest.approx(0.02, rel=0.05)


def test_draws_of_a_result_without_correlations_are_independent() -> None:
    """Results of earlier versions lack the member."""
    drawn = normal_draws(result(None), 4000)
    matrix = np.corrcoef([drawn[name] for name in DECLARED_PARAMETERS])
    assert np.abs(matrix - np.eye(len(matrix))).max() < 0.06
