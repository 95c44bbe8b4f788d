"""P value of a disturbance intensity with unknown correlation time."""

from __future__ import annotations

import numpy as np
import pytest

from identification.diagnosis.intensities import p_value_of


def test_no_gain_is_no_evidence() -> None:
    """For a complete model, the estimated intensity is zero in half of all cases."""
    assert p_value_of(0.0, 500.0) == 1.0


@pytest.mark.parametrize("level", [0.05, 0.01])
def test_the_bound_holds_and_is_at_most_tenfold(level: float) -> None:
    """Reference: largest likelihood ratio over intensity and correlation time in 1,500 records.

    Whittle's likelihood of the spectrum v (1 + q s(f)), s that of a Gauss-Markov process of mean 1
    and v at its best value, on a grid of q and of correlation times.  A bound may be wide, but not
    tenfold.
    """
    rng = np.random.default_rng(5)
    size, longest = 512, 50.0
    frequency = np.arange(1, size // 2) / size
    power = rng.exponential(size=(1500, frequency.size))
    nothing = -frequency.size * np.log(power.mean(axis=1))
    gains = np.zeros(1500)
    for time in np.geomspace(0.5, longest, 16):
        keep = np.exp(-1.0 / time)
        shape = (1 - keep**2) / (1.0 + keep**2 - 2.0 * keep * np.cos(2 * np.pi * frequency))
        for intensity in np.geomspace(3e-3, 3.0, 14):
            model = 1.0 + intensity * shape
            level_best = power @ (1.0 / model) / frequency.size
            value = -frequency.size * np.log(level_best) - np.log(model).sum()
            gains = np.maximum(gains, value - nothing)

    alarms = np.mean([p_value_of(float(gain), longest) < level for gain in gains])

    spread = np.sqrt(level / 1500)
    assert 0.1 * level < alarms < level + 3.0 * spread
