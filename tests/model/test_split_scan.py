"""A step and its tangents, in one loop, agree with CasADi's own derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import threads
from identification.arrays import Array
from identification.model.split_scan import SplitScan
from identification.work import metered, operations

Operation = Callable[[ca.SX, ca.SX], ca.SX]

SMOOTH: dict[str, Operation] = {
    "product": lambda a, b: a * b,
    "quotient": lambda a, b: a / (1.0 + b**2),
    "friction": lambda a, b: ca.tanh(a / 0.3) * b,
    "drag": lambda a, b: a * ca.fabs(a) + b,
    "exponential": lambda a, b: ca.exp(-(a**2)) * b,
    "cogging": lambda a, b: ca.sin(a) * ca.cos(b),
    "power": lambda a, b: (1.0 + a**2) ** 1.7 * b,
    "stick": lambda a, b: ca.if_else(ca.fabs(a) < 0.2, b, a),
    "constant": lambda a, b: ca.SX(2.0),
    "copy": lambda a, b: a,
}
"""Laws of the kinds that motors have, of two operands."""


@pytest.fixture(autouse=True)
def default_threads() -> Iterator[None]:
    """The number of threads is that of the machine again after a test."""
    yield
    threads._told = None


def tangent_step(law: Operation) -> ca.Function:
    """Step of two states, two inputs and two parameters with a law between all pairs of them."""
    x, u, p = (ca.SX.sym(name, 2) for name in "xup")
    dx, dp = ca.SX.sym("dx", 2), ca.SX.sym("dp", 2)
    following = ca.vertcat(
        0.9 * x[0] + 0.05 * law(x[0], p[0]), 0.8 * x[1] + 0.02 * law(u[0], x[0]) + 0.1 * p[1]
    )
    output = ca.vertcat(law(p[0], p[1]) + x[0], law(x[1], u[1]))
    both, seeds = ca.vertcat(x, p), ca.vertcat(dx, dp)
    slopes = [ca.jtimes(each, both, seeds) for each in (following, output)]
    return ca.Function("tangent", [x, dx, u, p, dp], [following, slopes[0], output, slopes[1]])


def problem(
    lanes: int, rows: list[int]
) -> tuple[list[Array], Array, Array, list[Array], list[Array]]:
    """Inputs, parameter, seeds, states and slopes of records of so many rows."""
    rng = np.random.default_rng(lanes)
    return (
        [rng.normal(size=(each, 2)) for each in rows],
        rng.normal(size=2),
        rng.normal(size=(2, lanes)),
        [rng.normal(size=2) for _ in rows],
        [rng.normal(size=(2, lanes)) for _ in rows],
    )


def repeated(
    step: ca.Function, inputs: Array, parameter: Array, seeds: Array, state: Array, slopes: Array
) -> tuple[Array, Array, Array, Array]:
    """The same by CasADi's virtual machine, row by row."""
    outputs, tangents = [], []
    for row in inputs:
        columns = [
            [
                np.ravel(part.full())
                for part in step(*map(ca.DM, (state, slope, row, parameter, seed)))
            ]
            for slope, seed in zip(slopes.T, seeds.T, strict=True)
        ]
        state = columns[0][0]
        outputs.append(columns[0][2])
        slopes, tangent = (np.column_stack([each[k] for each in columns]) for k in (1, 3))
        tangents.append(tangent)
    return state, slopes, np.array(outputs), np.array(tangents)


@pytest.mark.parametrize("rows", [[30, 7], [1_100]], ids=["unoptimised", "optimised"])
@pytest.mark.parametrize("law", SMOOTH)
def test_tangents_are_those_of_casadi(law: str, rows: list[int]) -> None:
    """States, readings and tangents of each record agree to rounding."""
    step = tangent_step(SMOOTH[law])
    given_problem = problem(11, rows)
    found = SplitScan(step, 10, f"test{law}")(*given_problem)
    inputs, parameter, seeds, states, slopes = given_problem
    for k in range(len(rows)):
        first = slice(0, 30)
        expected = repeated(step, inputs[k][first], parameter, seeds, states[k], slopes[k])
        for each, own in zip(expected[2:], (found[2][k], found[3][k]), strict=True):
            np.testing.assert_allclose(own[first], each, rtol=1e-9, atol=1e-9)
        if rows[k] <= 30:
            np.testing.assert_allclose(found[0][k], expected[0], rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(found[1][k], expected[1], rtol=1e-9, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(lanes=st.integers(1, 70), rows=st.lists(st.integers(0, 40), min_size=1, max_size=4))
def test_results_and_work_do_not_depend_on_the_number_of_threads(
    lanes: int, rows: list[int]
) -> None:
    """Groups of lanes compute their states each for itself, with the same numbers."""
    scan = SplitScan(tangent_step(SMOOTH["friction"]), 10, "testthreads")
    given_problem = problem(lanes, rows)
    found = []
    for number in (1, 2, 16):
        threads.use_threads(number)
        with metered():
            parts = scan(*given_problem)
            found.append((operations(), [each.tobytes() for part in parts for each in part]))
    assert found[0] == found[1] == found[2]


def test_the_callers_states_and_slopes_are_not_changed() -> None:
    """A pass returns new ones, so the next pass begins at the same place."""
    scan = SplitScan(tangent_step(SMOOTH["drag"]), 10, "testown")
    given_problem = problem(8, [20])
    first = scan(*given_problem)
    second = scan(*given_problem)
    np.testing.assert_array_equal(first[1][0], second[1][0])


def test_a_diverging_state_makes_its_tangents_not_a_number() -> None:
    """A fit recognises a diverging simulation by readings that are not finite."""
    inputs, parameter, seeds, states, slopes = problem(3, [5])
    states[0][0] = np.inf
    *_, outputs, tangents = SplitScan(tangent_step(SMOOTH["product"]), 10, "testinf")(
        inputs, parameter, seeds, states, slopes
    )
    assert not np.isfinite(outputs[0][:, 0]).any()
    assert not np.isfinite(tangents[0][-1]).all()
