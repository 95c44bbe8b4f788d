"""Laws of friction cover those of real motors."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from identification.effects.friction import QuadraticDrag, ViscousTemperature
from identification.model.term import Signals, Values

Array = NDArray[np.float64]

HEAT = np.linspace(-10.0, 100.0, 120)


def factor(rate: float, form: float) -> Array:
    """Friction at each temperature relative to 25 degC."""
    t = ca.SX.sym("t")
    none = [ca.SX(0)] * 4
    signals = Signals(none[0], none[1], none[2], t, *none)
    found = ViscousTemperature().factor(signals, Values(), Values(rate=rate, form=form))
    answer: Array = np.asarray(ca.Function("b", [t], [found])(HEAT[None, :]))[0]
    return answer


@pytest.mark.parametrize(
    ("law", "tolerance"),
    [
        (np.exp(-0.02 * (HEAT - 25.0)), 1e-6),
        (1.0 - 0.008 * (HEAT - 25.0), 1e-4),
        (1.0 / (1.0 + 0.02 * (HEAT - 25.0)), 1e-6),
        (np.exp(800.0 / (HEAT + 95.0) - 800.0 / 120.0), 0.1),
    ],
    ids=["exponential", "straight", "hyperbola", "Vogel"],
)
def test_grease_of_every_usual_law_is_met(law: Array, tolerance: float) -> None:
    """From -10 to 100 degC, relative error; Vogel's law falls by a factor of 200."""

    def error(x: Array) -> Array:
        return np.asarray(np.log(x[2] * factor(x[0], x[1])) - np.log(law))

    starts = [(0.01, 0.5, 1.0), (0.02, -0.5, 1.0), (0.007, 0.9, 1.0)]
    bounds = ([-0.05, -2.0, 0.5], [0.1, 1.0, 2.0])
    costs = [np.abs(least_squares(error, x, bounds=bounds).fun).max() for x in starts]

    assert min(costs) < tolerance


def test_the_form_of_grease_has_no_gap_where_it_is_exponential() -> None:
    """Through zero the factor changes by as little as the shape parameter."""
    forms = np.linspace(-1e-2, 1e-2, 41)

    factors = np.array([factor(0.02, form) for form in forms])

    steps = np.abs(np.diff(np.log(factors), axis=0))
    assert steps.max() < 2.0 * np.median(steps.max(axis=1))


def test_a_fan_may_differ_between_its_directions() -> None:
    """The asymmetry is half the difference over the mean."""
    w = ca.SX.sym("w")
    none = [ca.SX(0)] * 6
    signals = Signals(none[0], w, *none)
    values = Values(torque=0.2, exponent=2.0, asymmetry=0.3)
    torque = ca.Function("t", [w], [QuadraticDrag(1.0, 100.0).torque(signals, Values(), values)])

    there, back = float(torque(100.0)), float(torque(-100.0))

    assert there == pytest.approx(-0.2 * 1.3, rel=1e-4)
    assert back == pytest.approx(0.2 * 0.7, rel=1e-4)
