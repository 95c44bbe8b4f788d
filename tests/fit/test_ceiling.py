"""Upper bound of the noise of a channel, independent of the fitted model."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from identification.fit.campaign import campaign_of
from identification.fit.ceiling import bounded_noise, noise_ceiling
from identification.ingest import read_run
from identification.model.excitation import Record

DATA = Path(__file__).parents[2] / "data" / "brush_drop_servo"
TRUTH = json.loads((DATA / "truth.json").read_text(encoding="utf-8"))["noise"]
NOISE = np.array([TRUTH["current_A"], TRUTH["speed_rad_s"]])


@pytest.fixture(scope="module")
def records() -> tuple[Record, ...]:
    """Training records of a campaign with a hidden brush drop."""
    runs = [read_run(path) for path in sorted(DATA.glob("training_*.csv"))]
    return campaign_of(runs, []).training


def test_a_useless_model_does_not_raise_the_noise_to_the_signal(
    records: tuple[Record, ...],
) -> None:
    """With reversed sign in all runs, the best model is i = 0, and its residual is the signal."""
    size = np.std(np.concatenate([record.measured for record in records]), axis=0)

    noise = bounded_noise(records, size, error=size)

    assert np.all(size > 10.0 * noise)


def test_the_ceiling_is_above_the_noise_whatever_is_hidden(records: tuple[Record, ...]) -> None:
    """The bound must not fall below the true noise, also with a hidden brush drop."""
    assert np.all(noise_ceiling(records) > NOISE)


def test_the_ceiling_is_not_used_if_the_model_explains_the_runs(
    records: tuple[Record, ...],
) -> None:
    """In a speed loop the voltage contains the sensor noise, so the bound would be invalid."""
    large = np.array([1.0, 20.0])

    np.testing.assert_array_equal(bounded_noise(records, large, error=large), large)
