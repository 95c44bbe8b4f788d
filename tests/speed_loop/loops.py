"""Speed loops with given poles, and random stable ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.speed_loop.loop import Loop


def loop_with(numerator: list[float], closed: Sequence[float] | NDArray[np.floating[Any]]) -> Loop:
    """Loop with the given closed-loop numerator and monic denominator."""
    denominator = np.array([closed], dtype=float)
    denominator[:, 1:] -= numerator
    return Loop(np.array([numerator], dtype=float), denominator)


RATES = st.floats(-2, 2).map(lambda exponent: 10.0**exponent)


@st.composite
def stable_loops(draw: st.DrawFn) -> Loop:
    """Loops with two or three stable poles, possibly repeated, and up to two zeros."""
    poles: list[complex] = [-draw(RATES)]
    decay = draw(RATES)
    swing = decay * draw(st.sampled_from([0.0, 1e-9, 1e-4, 0.3, 1.0, 7.0]))
    apart = 0.0 if swing else draw(st.sampled_from([0.0, 1e-7, 0.1, 3.0]))
    pair: list[complex] = [-decay + 1j * swing, -decay * (1 + apart) - 1j * swing]
    poles = poles + pair if draw(st.booleans()) else pair
    further = -draw(RATES)
    swing = further * draw(st.sampled_from([0.3, 7.0]))
    poles += draw(
        st.sampled_from([[], [], [further], [further + 1j * swing, further - 1j * swing]])
    )
    closed = np.real(np.poly(poles))
    final = draw(st.floats(0.1, 3.0))
    lead = draw(st.floats(-0.5, 3.0))
    numerator = [lead * closed[-2], final * closed[-1]]
    if len(poles) > 2:
        numerator = [draw(st.floats(0, 1)) * closed[-3], *numerator]
    return loop_with([0.0] * (len(poles) - len(numerator)) + numerator, closed)
