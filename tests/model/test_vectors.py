"""Vector functions agree with the scalar functions."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np
import pytest

from identification.model import lowering, machine
from identification.model.scan import Scan

FUNCTIONS = {
    "exp": (ca.exp, np.linspace(-700.0, 700.0, 4001)),
    "log": (ca.log, np.geomspace(1e-300, 1e300, 4001)),
    "sin": (ca.sin, np.linspace(-1e4, 1e4, 4001)),
    "cos": (ca.cos, np.linspace(-1e4, 1e4, 4001)),
    "pow": (lambda x: x**2.7, np.geomspace(1e-80, 1e80, 4001)),
}


def scanned(function: object, points: np.ndarray) -> np.ndarray:
    """Values of a function of the carry at many points, one lane each."""
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p")
    step = ca.Function("step", [x, u, p], [x, function(x)])  # type: ignore[operator]
    lanes = np.zeros((1, points.size))
    _, outputs = Scan(step)([np.zeros((1, 1))], lanes, [points[None, :]])
    return np.asarray(outputs[0][0, 0])


@pytest.fixture(params=[4, 8])
def width(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Width of the registers, if this processor has them."""
    lanes = int(request.param)
    if lanes > machine.vector_width():
        pytest.skip("the processor has no registers of this width")
    for module in (lowering, machine):
        monkeypatch.setattr(module, "vector_width", lambda: lanes)
    machine.vector_functions.cache_clear()
    yield lanes
    machine.vector_functions.cache_clear()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_of_registers_is_within_four_units_of_the_last_place(
    name: str, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The specified accuracy of libmvec is four ulp; the scalar functions are the reference."""
    function, points = FUNCTIONS[name]
    assert all(f"N{width}v" in symbol for symbol in machine.vector_functions().values())
    fast = scanned(function, points)
    monkeypatch.setattr(lowering, "vector_functions", dict)
    slow = scanned(function, points)
    assert np.all(np.abs(fast - slow) <= 4 * np.spacing(np.abs(slow)))
