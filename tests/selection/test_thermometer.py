"""A temperature log in coarse steps leaves the temperature axis uncertain."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.selection.omitted import consider_variances
from identification.selection.thermometer import thermometer_errors
from tests.motors import drive, motor_named, simulated

Array = NDArray[np.float64]
MOTOR = motor_named("servo 100 W")
NOISE = 0.001


def _fitted(step: float, seed: int, rows: int = 2000) -> Fit:
    """Nominal fit of three runs that warm by 1.2 K, logged in steps without noise.

    Args:
        step: Step of the log [K]; zero for an exact one.
        seed: Seed of temperatures, voltages and noise.
        rows: Samples of a run.
    """
    rng = np.random.default_rng(seed)
    time = MOTOR.interval * np.arange(rows, dtype=np.float64)
    runs = []
    for k in range(3):
        voltage = drive(MOTOR, "steps", rows, rng)
        body = 25.0 + 30.0 * k + rng.uniform(-0.5, 0.5) + 1.2 * time / time[-1]
        exact = simulated(MOTOR.vector, MOTOR.interval, voltage, body, np.zeros(2), magnet=body)
        current, speed = (exact + NOISE * exact.std(0) * rng.standard_normal(exact.shape)).T
        shown = step * np.round(body / step) if step else body
        runs.append(Run(f"{k}.csv", f"{k:064d}", time, voltage, current, speed, shown))
    return fit_declared(campaign_of(runs, ()).training, "zoh")


def _spread(fit: Fit) -> tuple[Array, Array]:
    """(7,) standard deviations without and with the error of the log."""
    errors = thermometer_errors(fit, effective_fraction(fit))
    own = np.diag(fit.equations.covariance()) + consider_variances(fit, errors)
    return fit.deviations, np.sqrt(own) * fit.coordinates.slopes(fit.position)


def test_intervals_include_the_steps_of_the_thermometer() -> None:
    """With 1 K steps, resistances of many motors scatter as the intervals with the error say.

    Without it, they miss the true value by several standard deviations, however many samples.
    """
    narrow, wide = [], []
    for seed in range(8):
        fit = _fitted(1.0, seed)
        missed = fit.values[:7] - MOTOR.vector
        without, included = _spread(fit)
        narrow.append((missed / without)[0])
        wide.append((missed / included)[:4])

    assert np.sqrt(np.mean(np.square(narrow))) > 2.0
    assert np.abs(wide).max() < 3.0
    assert np.sqrt(np.mean(np.square(wide))) < 1.5


@pytest.mark.parametrize("step", [0.0, 1e-3])
def test_a_fine_log_changes_nothing(step: float) -> None:
    """An error of 0.3 mK is far below the noise of the resistance, and an exact log has none."""
    fit = _fitted(step, 1)

    assert thermometer_errors(fit, effective_fraction(fit)) == ()


def test_the_width_is_that_of_rounding() -> None:
    """Steps twice as large widen the resistance by twice as much: it is no matter of samples."""
    spreads = [
        np.sqrt(np.subtract(*np.square(_spread(_fitted(step, 3))[::-1])))[0] for step in (0.3, 0.6)
    ]

    assert spreads[1] / spreads[0] == pytest.approx(2.0, rel=0.2)
