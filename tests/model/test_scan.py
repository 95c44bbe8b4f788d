"""The compiled loop agrees with CasADi's virtual machine, lane by lane."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.errors import ComputationError
from identification.model import interpreter, scan
from identification.model.instructions import without_repeats
from identification.model.loop import lower
from identification.model.lowering import LANES
from identification.model.scan import Effort, Scan, scan_of

Array = NDArray[np.float64]
Operation = Callable[[ca.SX, ca.SX], ca.SX]

OPERATIONS: dict[str, Operation] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "divide by a number": lambda a, b: a / 3,
    "negate": lambda a, b: -a,
    "square": lambda a, b: a**2,
    "twice": lambda a, b: a + a,
    "invert": lambda a, b: 1 / a,
    "root": lambda a, b: ca.sqrt(ca.fabs(a)),
    "exp": lambda a, b: ca.exp(a),
    "log": lambda a, b: ca.log(ca.fabs(a)),
    "sin": lambda a, b: ca.sin(a),
    "cos": lambda a, b: ca.cos(a),
    "tanh": lambda a, b: ca.tanh(a),
    "absolute": lambda a, b: ca.fabs(a),
    "floor": lambda a, b: ca.floor(a),
    "ceil": lambda a, b: ca.ceil(a),
    "sign": lambda a, b: ca.sign(a),
    "power": lambda a, b: ca.fabs(a) ** b,
    "constant power": lambda a, b: ca.fabs(a) ** 1.7,
    "minimum": lambda a, b: ca.fmin(a, b),
    "maximum": lambda a, b: ca.fmax(a, b),
    "copy sign": lambda a, b: ca.copysign(a, b),
    "less": lambda a, b: a < b,
    "less or equal": lambda a, b: a <= b,
    "equal": lambda a, b: a == b,
    "different": lambda a, b: a != b,
    "not": lambda a, b: ca.logic_not(a),
    "and": lambda a, b: ca.logic_and(a, b),
    "or": lambda a, b: ca.logic_or(a, b),
    "choice": lambda a, b: ca.if_else(a > b, a, b),
}
"""Every operation that the lowering translates."""

NUMBERS = st.floats(-30.0, 30.0).filter(lambda x: x == 0.0 or abs(x) > 1e-6)


def one_step(expression: Operation) -> ca.Function:
    """Step that applies the operation to carry, input and parameter in all pairs."""
    carry, given_input, parameter = (ca.SX.sym(name, 2) for name in "cup")
    outputs = [
        expression(carry[0], carry[1]),
        expression(given_input[0], given_input[1]),
        expression(parameter[0], parameter[1]),
        expression(carry[0], given_input[1]),
        expression(given_input[0], parameter[1]),
        expression(parameter[0], carry[1]),
    ]
    return ca.Function("step", [carry, given_input, parameter], [carry, ca.vertcat(*outputs)])


FORMS: dict[str, tuple[Effort, int]] = {
    "interpreted": ("once", 1),
    "unoptimised": ("some", 1),
    "optimised": ("some", 1001),
}
"""Forms of a loop: the effort and the number of rows for which it is chosen."""


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", OPERATIONS)
@settings(max_examples=25, deadline=None)
@given(numbers=st.lists(NUMBERS, min_size=6, max_size=6))
def test_each_operation_gives_what_casadi_gives(name: str, form: str, numbers: list[float]) -> None:
    """Reference: evaluation by CasADi, for operands from any source."""
    step, (effort, rows) = one_step(OPERATIONS[name]), FORMS[form]
    carry, given_input, parameter = np.array(numbers).reshape(3, 2)
    inputs = np.repeat(given_input[None, :], rows, axis=0)

    _, outputs = scan_of(step, effort=effort)([inputs], parameter[:, None], [carry[:, None]])

    expected = np.asarray(step(carry, given_input, parameter)[1]).ravel()
    np.testing.assert_allclose(outputs[0][0, :, 0], expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("name", ["add", "multiply", "divide", "exp", "tanh", "square"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("form", FORMS)
def test_not_a_number_and_infinity_survive(name: str, bad: float, form: str) -> None:
    """Reference: IEEE arithmetic, as in CasADi's virtual machine."""
    step, (effort, rows) = one_step(OPERATIONS[name]), FORMS[form]
    carry, given_input, parameter = np.array([[bad, 2.0], [3.0, bad], [bad, bad]])
    inputs = np.repeat(given_input[None, :], rows, axis=0)

    _, outputs = scan_of(step, effort=effort)([inputs], parameter[:, None], [carry[:, None]])

    expected = np.asarray(step(carry, given_input, parameter)[1]).ravel()
    np.testing.assert_array_equal(outputs[0][0, :, 0], expected)


def oscillator() -> ca.Function:
    """Step of a driven, damped oscillator that logs its energy and position."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("p", 2)
    following = ca.vertcat(
        x[0] + u[0] * x[1], x[1] + u[0] * (u[1] - p[0] * ca.sin(x[0]) - p[1] * x[1])
    )
    return ca.Function("step", [x, u, p], [following, ca.vertcat(ca.dot(x, x), x[0])])


def random_problem(lanes: int, rows: int, seed: int) -> tuple[Array, Array, Array]:
    """Inputs (rows, 2), parameters (2, lanes) and carries (2, lanes) of the oscillator."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([np.full(rows, 0.01), rng.normal(size=rows)])
    return inputs, rng.uniform(0.5, 2.0, (2, lanes)), rng.normal(size=(2, lanes))


@pytest.mark.parametrize("effort", ["once", "most"])
@pytest.mark.parametrize("lanes", [1, LANES - 1, LANES, LANES + 3])
def test_the_loop_equals_casadis_mapaccum(lanes: int, effort: Effort) -> None:
    """Reference: the step repeated by CasADi's mapaccum, one lane at a time."""
    step, rows = oscillator(), 40
    inputs, parameters, carries = random_problem(lanes, rows, seed=lanes)

    finals, outputs = scan_of(step, effort=effort)([inputs], parameters, [carries])

    repeated = step.mapaccum(rows)
    for lane in range(lanes):
        states, logged = repeated(carries[:, lane], inputs.T, parameters[:, lane])
        np.testing.assert_allclose(finals[0][:, lane], np.asarray(states)[:, -1], rtol=1e-12)
        np.testing.assert_allclose(outputs[0][:, :, lane], np.asarray(logged).T, rtol=1e-11)


def test_a_lane_that_diverges_leaves_the_others_alone() -> None:
    """Reference: the result without the diverging lane, bit for bit."""
    inputs, parameters, carries = random_problem(LANES, 30, seed=3)
    scan = scan_of(oscillator())
    clean = scan([inputs], parameters, [carries])[1][0]
    spoiled = parameters.copy()
    spoiled[0, 2] = np.nan

    outputs = scan([inputs], spoiled, [carries])[1][0]

    kept = np.arange(LANES) != 2
    assert np.isnan(outputs[-1, :, 2]).all()
    np.testing.assert_array_equal(outputs[:, :, kept], clean[:, :, kept])


def test_records_of_different_length_are_independent() -> None:
    """Reference: each record simulated alone."""
    scan = scan_of(oscillator())
    problems = [random_problem(5, rows, seed=rows) for rows in (1, 17, 60)]
    parameters = problems[0][1]

    finals, outputs = scan([p[0] for p in problems], parameters, [p[2] for p in problems])

    for k, (inputs, _, carries) in enumerate(problems):
        final, output = scan([inputs], parameters, [carries])
        np.testing.assert_array_equal(finals[k], final[0])
        np.testing.assert_array_equal(outputs[k], output[0])


def test_each_record_may_have_its_own_parameters() -> None:
    """Reference: each record simulated alone with its parameters."""
    scan = scan_of(oscillator())
    problems = [random_problem(4, 20, seed=seed) for seed in (1, 2)]

    _, outputs = scan(*zip(*problems, strict=True))

    for output, (inputs, parameters, carries) in zip(outputs, problems, strict=True):
        np.testing.assert_array_equal(output, scan([inputs], parameters, [carries])[1][0])


def test_a_record_without_rows_keeps_its_carry() -> None:
    """Zero repetitions return the carry unchanged."""
    _, parameters, carries = random_problem(3, 0, seed=0)

    finals, outputs = scan_of(oscillator())([np.zeros((0, 2))], parameters, [carries])

    np.testing.assert_array_equal(finals[0], carries)
    assert outputs[0].shape == (0, 2, 3)


def test_the_callers_arrays_are_not_changed() -> None:
    """The kernel overwrites its carry, so it must receive a copy."""
    inputs, parameters, carries = random_problem(LANES, 5, seed=0)
    before = carries.copy()

    scan_of(oscillator())([inputs], parameters, [carries])

    np.testing.assert_array_equal(carries, before)


@pytest.mark.parametrize("wrong", ["inputs", "parameters", "carry", "lanes"])
def test_wrong_shapes_are_refused_with_the_shapes(wrong: str) -> None:
    """The message gives the two rows that the step takes of each."""
    inputs, parameters, carries = random_problem(4, 6, seed=0)
    if wrong == "inputs":
        inputs = inputs[:, :1]
    elif wrong == "parameters":
        parameters = parameters[:1]
    elif wrong == "carry":
        carries = carries[:1]
    else:
        parameters = np.repeat(parameters, LANES, axis=1)

    with pytest.raises(ValueError, match=r"the step takes \(2, 2, 2\) on equally many lanes"):
        scan_of(oscillator())([inputs], parameters, [carries])


def test_a_step_must_return_the_carry_that_it_takes() -> None:
    """A loop whose carry changes length cannot be repeated."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")

    with pytest.raises(ValueError, match="takes a carry of 2 and returns one of 1"):
        Scan(ca.Function("step", [x, u, p], [x[0], x]))


def test_an_operation_without_translation_is_named() -> None:
    """The inverse sine is not an operation of the lowering."""
    x, u, p = (ca.SX.sym(name) for name in "xup")

    with pytest.raises(ComputationError, match="has no translation; expected arithmetic"):
        lower(ca.Function("step", [x, u, p], [ca.asin(x), x]), None, LANES)


def noted(widths: list[int]) -> Callable[[int, int], Iterator[tuple[int, int]]]:
    """The division into blocks, which notes the widths."""
    divide = scan._blocks

    def blocks(lanes: int, width: int) -> Iterator[tuple[int, int]]:
        for first, own in divide(lanes, width):
            widths.append(own)
            yield first, own

    return blocks


@pytest.mark.parametrize("lanes", [9, 16, 40])
def test_a_lane_has_the_same_result_in_wide_and_narrow_blocks(
    lanes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wide blocks are a matter of speed alone: every operation agrees to the last digit.

    They are compiled once the loop has run often.
    """
    x, u, p = (ca.SX.sym(name) for name in "xup")
    found = [function(x + u, p) for function in OPERATIONS.values()]
    step = ca.Function("step", [x, u, p], [0.5 * x + u, ca.vertcat(*found)])
    rng = np.random.default_rng(0)
    rows = [rng.normal(size=(2_000, 1)) for _ in range(2)]
    starts = [rng.normal(size=(1, lanes)) for _ in rows]
    parameters = rng.normal(size=(1, lanes))

    monkeypatch.setattr(scan, "threads", lambda: 1)
    widths: list[int] = []
    monkeypatch.setattr(scan, "_blocks", noted(widths))
    monkeypatch.setattr(scan, "_WIDE", 2 * LANES)
    loop = Scan(step)
    results = [loop(rows, parameters, starts)]
    assert max(widths) == LANES
    results += [loop(rows, parameters, starts) for _ in range(scan._OFTEN)]

    assert max(widths) == 2 * LANES
    (narrow_ends, narrow), (wide_ends, wide) = results[0], results[-1]
    np.testing.assert_array_equal(wide_ends, narrow_ends)
    np.testing.assert_array_equal(wide, narrow)


def test_a_friction_that_torque_and_power_need_is_computed_once() -> None:
    """The values are the same to the last bit."""
    speed, gain = ca.SX.sym("speed"), ca.SX.sym("gain")
    friction = ca.Function("friction", [speed, gain], [ca.tanh(gain * speed)])
    torque, again = friction(speed, gain), friction(speed, gain)
    step = ca.Function("losses", [speed, gain], [torque, again * speed])

    reduced = without_repeats(step)

    codes = [reduced.instruction_id(k) for k in range(reduced.n_instructions())]
    assert codes.count(ca.OP_TANH) == 1
    for numbers in [(0.3, 2.0), (-4.0, 0.1), (math.inf, 1.0)]:
        assert list(map(float, reduced(*numbers))) == list(map(float, step(*numbers)))


def test_a_conditional_value_and_its_tangent_are_one_selection_each() -> None:
    """The loop gives the values of CasADi, in both branches and at their border."""
    speed, slope = ca.SX.sym("speed"), ca.SX.sym("slope")
    torque = ca.if_else(speed > 1.0, ca.exp(speed), 3.0 * speed)
    tangent = ca.jtimes(torque, speed, slope)
    none = ca.SX.sym("none", 0)
    carry = ca.vertcat(speed, slope)
    step = ca.Function("step", [carry, none, none], [ca.vertcat(torque, tangent), tangent])

    text = lower(step, None, LANES)

    assert text.count("= select") == 2
    starts = np.array([[0.5, 1.0, np.nextafter(1.0, 2.0), 1.5], [1.0, -2.0, 3.0, 0.5]])
    (ends,), _ = Scan(step)([np.zeros((1, 0))], np.zeros((0, 4)), [starts])
    for start, end in zip(starts.T, ends.T, strict=True):
        expected = np.array(step(start, [], [])[0]).ravel()
        np.testing.assert_allclose(end, expected, rtol=1e-14)


def test_the_same_step_is_compiled_once() -> None:
    """Two functions with equal operations share one loop."""
    assert scan_of(oscillator()) is scan_of(oscillator())


def test_the_first_loops_of_many_threads_at_once_compute_the_same() -> None:
    """Threads that find no interpreter and no linker load one each; all results are equal.

    Each loop holds its own, so none is unloaded while another thread computes.
    """
    step = oscillator()
    inputs, parameters, carries = random_problem(4 * LANES, 40, seed=5)
    expected = Scan(step, effort="once")([inputs], parameters, [carries])[0][0]

    for _ in range(20):
        interpreter._machine.cache_clear()
        scans = [Scan(step, effort="once") for _ in range(8)]
        with ThreadPoolExecutor(8) as pool:
            found = [pool.submit(scan, [inputs], parameters, [carries]) for scan in scans]

        for future in found:
            np.testing.assert_array_equal(future.result()[0][0], expected)
