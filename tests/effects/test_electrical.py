"""Laws of the armature circuit cover those of real motors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import erf

from identification.effects.electrical import BrushDrop
from identification.model.term import Signals, Values

Array = NDArray[np.float64]

TERM = BrushDrop(10.0, 1.0)
NAMES = [parameter.name for parameter in TERM.parameters]


def drop_of(current: Array, *values: float) -> Array:
    """Brush voltage at each current, with the sign of the current [V]."""
    i = ca.SX.sym("i")
    nothing = ca.SX(0)
    signals = Signals(i, *[nothing] * 7)
    own = dict(zip(NAMES, values, strict=True))
    voltage = ca.Function("v", [i], [TERM.voltage(signals, Values(), Values(**own))])
    lost: Array = -np.asarray(voltage(current[None, :]))[0]
    return lost


@pytest.mark.parametrize(
    ("law", "tolerance"),
    [
        (lambda x: x / (1 + np.abs(x)), 1e-6),
        (lambda x: x / np.sqrt(1 + x**2), 1e-6),
        (np.tanh, 1e-3),
        (erf, 1e-3),
        (lambda x: np.sign(x) * -np.expm1(-np.abs(x)), 2e-3),
        (lambda x: np.arctan(np.pi / 2 * x) * 2 / np.pi, 1e-3),
    ],
    ids=["hyperbola", "root", "tanh", "erf", "exponential", "arctan"],
)
def test_knees_of_every_usual_law_are_met(law: Callable[[Any], Any], tolerance: float) -> None:
    """Errors relative to the full drop, from far below to far above the knee."""
    current = np.geomspace(1e-2, 20.0, 150)
    wanted = law(current)

    def error(x: Array) -> Array:
        return np.asarray(drop_of(current, x[0], *np.exp(x[1:]), 0.0) - wanted)

    fitted = least_squares(error, [1.0, 0.0, 0.3, 0.5], x_scale=0.1)

    assert np.abs(fitted.fun).max() < tolerance


@pytest.mark.parametrize("sharpness", [0.6, 2.0, 8.0])
@pytest.mark.parametrize("openness", [0.04, 1.0, 2.5])
def test_near_no_current_brushes_are_a_resistance(sharpness: float, openness: float) -> None:
    """For each shape the drop is odd and continuous where its series takes over."""
    current = np.geomspace(3e-3, 3.0, 4000)

    drop = drop_of(current, 1.0, 1.0, sharpness, openness, 0.0)

    np.testing.assert_allclose(drop_of(-current, 1.0, 1.0, sharpness, openness, 0.0), -drop)
    slope = np.diff(drop) / np.diff(current)
    assert np.all(slope > -1e-9)
    assert np.all(np.diff(slope) < 1e-4)
    assert drop[-1] < 1.0
