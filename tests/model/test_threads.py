"""Number of threads of a calculation; the results do not depend on it."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import casadi as ca
import numpy as np
import pytest

from identification import threads
from identification.model.scan import LANES, scan_of


@pytest.fixture(autouse=True)
def afterwards_as_before() -> Iterator[None]:
    """Restore the default number of threads after each test."""
    yield
    threads._told = None


def test_the_default_is_one_thread_per_core() -> None:
    """Only cores that this process may use count, which may be fewer than the machine has."""
    assert threads.threads() == threads.cores() >= 1


def test_a_set_number_holds_until_the_next() -> None:
    """The last call determines the number of threads."""
    threads.use_threads(7)
    assert threads.threads() == 7
    threads.use_threads(1)
    assert threads.threads() == 1


def test_no_thread_at_all_is_refused() -> None:
    """The message contains the value and the expected range."""
    with pytest.raises(ValueError, match="most is 0; expected at least one thread"):
        threads.use_threads(0)


def test_one_thread_starts_no_other_and_gives_the_same_numbers() -> None:
    """One thread is the caller's own; the kernels and blocks are the same."""
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p")
    scan = scan_of(ca.Function("step", [x, u, p], [p * x + u, x]))
    inputs = [np.linspace(0.0, 1.0, 50)[:, None]]
    parameters = np.linspace(0.1, 0.9, 5 * LANES)[None, :]
    carries = [np.ones((1, 5 * LANES))]

    threads.use_threads(1)
    before = set(threading.enumerate())
    alone = scan(inputs, parameters, carries)
    assert set(threading.enumerate()) == before
    threads.use_threads(3)
    several = scan(inputs, parameters, carries)

    assert any(t.name.startswith("scan") for t in set(threading.enumerate()) - before)
    np.testing.assert_array_equal(alone[0][0], several[0][0])
    np.testing.assert_array_equal(alone[1][0], several[1][0])
