"""Step responses of random stable loops: properties that need no reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.speed_loop.loop import Loop
from identification.speed_loop.metrics import StepMetrics
from identification.speed_loop.step_response import (
    StepResponse,
    step_metrics,
)
from tests.speed_loop.loops import stable_loops

Array = NDArray[np.float64]


@settings(deadline=None, max_examples=15)
@given(stable_loops())
def test_every_event_satisfies_its_own_definition(loop: Loop) -> None:
    """The response is evaluated at and between the returned times; no reference is needed."""
    response = StepResponse(loop)
    step = step_metrics(response)

    def relative(time: float | Array) -> Array:
        """Speed divided by its final value."""
        return np.asarray(response.at(np.atleast_1d(time))[0] / step.steady_state[0])

    settling, rise = step.settling_time[0], step.rise_time[0]
    after = settling + np.geomspace(1e-6, 20, 500) * settling
    before = np.linspace(0, settling, 4001)
    rising, settled = relative(before), relative(after)
    tenth = _first_crossing(relative, before, rising, 0.1)
    assert np.abs(relative(settling) - 1) == pytest.approx(0.02, rel=1e-6)
    assert (np.abs(settled - 1) <= 0.02 * (1 + 1e-6)).all()
    assert tenth is None or relative(tenth + rise) == pytest.approx(0.9, abs=1e-6)
    peak = 1 + step.overshoot[0] / 100
    assert max(rising.max(), settled.max()) <= peak * (1 + 1e-9)
    if step.overshoot[0] > 0:
        assert relative(step.peak_time[0]) == pytest.approx(peak, rel=1e-9)
    else:
        assert np.isnan(step.peak_time[0])


def _first_crossing(
    relative: Callable[[Array], Array], grid: Array, values: Array, share: float
) -> float | None:
    """First crossing by bisection after a search on a grid; None where the grid is too coarse."""
    above = np.flatnonzero(values >= share)
    if not above.size or above[0] < 20:
        return None
    low, high = grid[above[0] - 1], grid[above[0]]
    for _ in range(45):
        middle = (low + high) / 2
        reached = relative(np.array([middle]))[0] >= share
        low, high = (low, middle) if reached else (middle, high)
    return float(high)


@settings(deadline=None, max_examples=6)
@given(
    st.lists(stable_loops(), min_size=2, max_size=5).filter(
        lambda x: len({y.numerator.shape for y in x}) == 1
    )
)
def test_batch_is_the_loops_one_by_one(loops: list[Loop]) -> None:
    """Reference: each loop alone."""
    batch = Loop(
        np.concatenate([loop.numerator for loop in loops]),
        np.concatenate([loop.open_denominator for loop in loops]),
    )

    together = step_metrics(StepResponse(batch))

    for k, loop in enumerate(loops):
        alone = step_metrics(StepResponse(loop))
        for field in fields(StepMetrics):
            one, of_many = getattr(alone, field.name)[0], getattr(together, field.name)[k]
            assert of_many == pytest.approx(one, rel=1e-9, nan_ok=True)
