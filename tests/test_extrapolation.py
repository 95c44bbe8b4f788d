"""A prediction beyond the fitted runs says so."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from identification.ingest import read_run
from identification.remarks import extrapolation

RANGES = {
    "voltage_V": [-12.0, 12.0], "current_A": [-5.0, 5.0], "speed_rad_s": [-200.0, 200.0],
    "temperature_degC": [25.0, 25.0],
}  # fmt: skip
RESULT = {
    "runs": [
        {"role": "training", "ranges": RANGES},
        {"role": "validation", "ranges": {name: [-1e3, 1e3] for name in RANGES}},
    ]
}
ROWS = 300


def _remark(**peaks: float) -> str:
    """Remark on a run whose channels reach these values, and else half of the fitted ones."""
    wave = np.sin(0.1 * np.arange(ROWS))
    sizes = {"voltage_V": 6.0, "current_A": 2.5, "speed_rad_s": 100.0} | peaks
    columns = {name: size * wave for name, size in sizes.items()}
    columns |= {"temperature_degC": np.full(ROWS, peaks.get("temperature_degC", 25.0))}
    frame = pd.DataFrame({"time_s": 1e-3 * np.arange(ROWS), **columns})
    return extrapolation(RESULT, read_run(frame, name="new.csv"), frame)


def test_run_within_the_fitted_ranges_has_no_remark() -> None:
    """Peaks 10 % beyond and 5 K are no extrapolation."""
    assert _remark() == ""
    assert _remark(voltage_V=14.0, temperature_degC=29.5) == ""


@pytest.mark.parametrize(
    ("channel", "value", "ranges"),
    [
        ("voltage_V", 24.0, "voltage −24.0 to 24.0 V, fitted −12.0 to 12.0 V"),
        ("current_A", 9.0, "current −9.00 to 9.00 A, fitted −5.00 to 5.00 A"),
        ("speed_rad_s", 400.0, "speed −400 to 400 rad/s, fitted −200 to 200 rad/s"),
        ("temperature_degC", 80.0, "temperature 80.0 to 80.0 °C, fitted 25.0 to 25.0 °C"),
    ],
)
def test_channel_beyond_its_fitted_range_is_named_with_both_ranges(
    channel: str, value: float, ranges: str
) -> None:
    """Validation runs were not fitted and widen no range."""
    remark = _remark(**{channel: value})

    assert f"new.csv leaves the range of the fitted runs ({ranges}), where" in remark


@pytest.mark.parametrize("runs", [None, [], [{"role": "training"}], ["x"], {"a": 1}])
def test_result_without_ranges_has_no_remark(runs: object) -> None:
    """Results of earlier versions lack them."""
    frame = pd.DataFrame({
        "time_s": 1e-3 * np.arange(ROWS), "voltage_V": 1e3 * np.ones(ROWS),
        "current_A": np.ones(ROWS), "speed_rad_s": np.ones(ROWS),
    })  # fmt: skip

    assert extrapolation({"runs": runs}, read_run(frame, name="new.csv"), frame) == ""
