"""Fits of motors with a parameter at a bound of its range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import make_campaign
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.model.parameter import Coordinates
from tests.effects.hidden import records_of_bench


@pytest.fixture(scope="module")
def servo() -> Fit:
    """Fit of a servo without hidden effects, all parameters inside their ranges."""
    measured = make_campaign("servo_150w", [], seed=3, rows=400, training=1, validation=1)
    return fit_declared(records_of_bench(measured).training, "zoh")


def bounded(fit: Fit, name: str) -> Coordinates:
    """Coordinates whose lower bound of one parameter is its fitted value."""
    values = dict(zip(fit.coordinates.names, fit.values, strict=True))
    return Coordinates(
        [
            replace(p, lower=float(values[name])) if p.name == name else p
            for p in fit.coordinates.parameters
        ]
    )


@pytest.mark.parametrize("name", ["Ra25", "J", "b"])
def test_a_step_beyond_a_bound_is_not_predicted(servo: Fit, name: str) -> None:
    """Holding one coordinate of a Newton step d costs d^2 / (2 (H^-1)_kk), by Schur complement."""
    coordinates = bounded(servo, name)
    k, matrix = coordinates.names.index(name), servo.equations.matrix
    step = np.zeros(servo.position.size)
    step[k] = -1.0 / np.sqrt(matrix[k, k])
    step[k - 1] = 2.0 / np.sqrt(matrix[k - 1, k - 1])
    equations = replace(servo.equations, gradient=matrix @ step)
    promised = float(0.5 * step @ matrix @ step)
    held = step[k] ** 2 / (2.0 * np.linalg.inv(matrix)[k, k])

    within = equations.decrement_within(np.maximum(servo.position, coordinates.lower), coordinates)

    assert within == pytest.approx(promised - held, abs=1e-4 * promised)


def test_inside_the_ranges_the_predicted_decrease_is_complete(servo: Fit) -> None:
    """With no parameter at its bound, the decrease of a full step d is d' H d / 2."""
    matrix = servo.equations.matrix
    step = 1.0 / np.sqrt(np.diag(matrix))
    equations = replace(servo.equations, gradient=matrix @ step)

    within = equations.decrement_within(servo.position, servo.coordinates)

    assert within == pytest.approx(0.5 * step @ matrix @ step, rel=1e-6)
