"""Passes in blocks of rows: their memory, and their equality with one pass."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from identification.model.blocks import blocks, single
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.scan import scan_of
from identification.model.simulate import Simulator, initial_states
from identification.model.substeps import evenly
from identification.model.tangent import tangent
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]
SERVO = motor_named("servo 100 W")


def divided_into(substeps: int) -> tuple[Simulator, list[Array]]:
    """Simulator of two records of 4,000 samples with equal substeps, and its initial states."""
    records = records_of(campaign(SERVO, seed=3, runs=2, rows=4000))
    simulator = Simulator.fitting(MotorModel(), records, SERVO.vector)
    simulator = replace(simulator, substeps=evenly([4000, 4000], substeps))
    return simulator, [initial_states(simulator.model, record) for record in records]


def peak_of(action: Callable[[], object]) -> int:
    """Peak of the memory that an action allocates [bytes]."""
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("what", ["tangents", "readings"])
def test_memory_of_a_pass_does_not_grow_with_the_substeps(what: str) -> None:
    """With 16 substeps the samples fill two blocks of rows, with 64 eight."""
    peaks = []
    for substeps in (16, 64):
        simulator, states = divided_into(substeps)
        # The inputs of all rows exist for as long as the simulator.
        assert simulator.inputs[0].shape[0] == 4000 * substeps
        assert simulator.first_rows is not None
        lanes = np.repeat(SERVO.vector[:, None], 16, axis=1)
        if what == "tangents":
            peaks.append(peak_of(lambda: tangent(simulator, SERVO.vector, states, np.eye(7))))  # noqa: B023
        else:
            peaks.append(peak_of(lambda: simulator.logged(lanes, states)))  # noqa: B023

    assert peaks[1] < 1.1 * peaks[0]


def test_substeps_are_refined_with_little_memory() -> None:
    """A hopeless tolerance asks for 64 substeps everywhere: 512,000 rows of 13 inputs and an error.

    They would take 130 MB at once.
    """
    simulator, states = divided_into(1)
    found: list[Simulator] = []

    peak = peak_of(
        lambda: found.append(simulator.with_tolerance(SERVO.vector, states, np.full(2, 1e-300)))
    )

    assert found[0].substeps is not None
    assert max(each.counts.max() for each in found[0].substeps) == 64
    assert peak < 60e6


@pytest.mark.parametrize("most", [7, 40, 10_000])
def test_every_sample_is_in_one_block(most: int) -> None:
    """Records of unequal length end in different blocks, and none is left out."""
    counted = [np.zeros(length) for length in (90, 31, 1)]

    for going, parts in blocks([90, 31, 1], rows=122, most=most):
        for k, part in zip(going, parts, strict=True):
            counted[k][part] += 1

    assert all((each == 1).all() for each in counted)


def test_one_lane_in_blocks_is_that_of_one_pass() -> None:
    """Each block continues from the carry of the one before; blocks have 8,192 rows."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
    following = ca.vertcat(x[0] + 1e-3 * x[1], x[1] - 1e-3 * p * x[0] + u)
    scan = scan_of(ca.Function("step", [x, u, p], [following, ca.vertcat(x, u)]))
    inputs = 1e-3 * np.random.default_rng(5).normal(size=(20_000, 1))
    values, carry = np.full((1, 1), 4.0), np.ones((2, 1))

    whole = scan([inputs], values, [carry])[1][0][:, :, 0]

    assert np.array_equal(single(scan, inputs, values, carry), whole)
