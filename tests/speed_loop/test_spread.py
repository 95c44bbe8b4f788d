"""Feedback metrics over posterior draws: spread, undefined and infinite values, errors."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.errors import OptionError
from identification.speed_loop import METRIC_UNITS, feedback_metrics
from identification.speed_loop.metrics import quantity

PAPER = {
    "Ra25": 0.59,
    "alpha_Ra": 0.004,
    "Kt25": 0.071,
    "alpha_Kt": -0.002,
    "J": 0.01,
    "b": 0.1,
    "L": 0.5,
}


def draws(count: int, spread: float = 0.05) -> dict[str, NDArray[np.float64]]:
    """Motors around that of the source, with log-normal parameters."""
    rng = np.random.default_rng(7)
    return {
        name: value * np.exp(spread * rng.standard_normal(count)) for name, value in PAPER.items()
    }


def test_one_draw_gives_the_table_of_the_source() -> None:
    """Reference: table 1 of the source; the standard deviation of one draw is zero."""
    cold, hot = feedback_metrics(PAPER, [25.0, 125.0], ["P:1"])

    assert [cold["temperature_degC"], hot["temperature_degC"]] == [25.0, 125.0]
    assert cold["controller"] == hot["controller"] == "P:1"
    assert round(cold["rise_time_s"]["median"], 4) == 0.7193
    assert round(hot["rise_time_s"]["median"], 4) == 0.7144
    assert round(cold["settling_time_s"]["mean"], 4) == 1.2826
    assert round(hot["settling_time_s"]["mean"], 4) == 1.2781
    assert round(cold["steady_state"]["q05"], 4) == 0.5258
    assert round(hot["steady_state"]["q95"], 4) == 0.3982
    assert cold["overshoot_percent"]["mean"] == hot["overshoot_percent"]["mean"] == 0
    assert cold["rise_time_s"]["sd"] == 0


def test_entry_holds_every_metric_of_the_contract_with_its_unit() -> None:
    """Reference: the nine names and the fields of a quantity in the contract."""
    (entry,) = feedback_metrics(PAPER, [25.0], ["P:1"])

    assert set(METRIC_UNITS) == {
        "rise_time_s", "settling_time_s", "peak", "peak_time_s", "overshoot_percent",
        "steady_state", "gain_margin_db", "phase_margin_deg", "bandwidth_rad_s",
    }  # fmt: skip
    for name, unit in METRIC_UNITS.items():
        assert {"mean", "sd", "q05", "median", "q95", "unit"} <= set(entry[name])
        assert entry[name]["unit"] == unit


def test_controllers_vary_slower_than_temperatures() -> None:
    """The temperatures of one controller are adjacent."""
    entries = feedback_metrics(PAPER, [25.0, 125.0], ["P:1", "PI:1,2"])

    order = [(entry["controller"], entry["temperature_degC"]) for entry in entries]
    assert order == [("P:1", 25.0), ("P:1", 125.0), ("PI:1,2", 25.0), ("PI:1,2", 125.0)]


def test_spread_is_that_of_the_metric_over_the_draws() -> None:
    """Reference: numpy's statistics of 40 draws evaluated one by one."""
    motors = draws(40)
    alone = [
        feedback_metrics({n: v[k] for n, v in motors.items()}, [80.0], ["PI:1,2"])[0]
        for k in range(40)
    ]

    (together,) = feedback_metrics(motors, [80.0], ["PI:1,2"])

    for name in ("rise_time_s", "settling_time_s", "steady_state", "bandwidth_rad_s"):
        values = np.array([entry[name]["median"] for entry in alone])
        found = together[name]
        assert found["mean"] == pytest.approx(values.mean())
        assert found["sd"] == pytest.approx(values.std())
        for share, field in ((0.05, "q05"), (0.5, "median"), (0.95, "q95")):
            assert found[field] == pytest.approx(np.quantile(values, share))


def test_unstable_loop_is_reported_and_has_no_times() -> None:
    """An integral gain of 1e5 makes the loop unstable; undefined values are null in JSON."""
    (entry,) = feedback_metrics(draws(50), [25.0], ["PI:1,1e5"])

    assert entry["stable_probability"] == 0
    assert entry["statement"].startswith("unstable in all 50 draws: the speed does not settle")
    for name in ("rise_time_s", "settling_time_s", "peak", "peak_time_s", "bandwidth_rad_s"):
        assert entry[name]["median"] is None
        assert entry[name]["defined_fraction"] == 0
    assert entry["gain_margin_db"]["q95"] < 0
    json.dumps(entry, allow_nan=False)


def test_loop_near_the_stability_limit_has_a_stable_probability() -> None:
    """Three of four draws satisfy Routh's criterion for s^3 + a1 s^2 + a0 s + c."""
    motors = {name: np.full(4, value) for name, value in PAPER.items()}
    motors["b"] = np.array([0.1, 0.1, 0.1, 0.001])

    (entry,) = feedback_metrics(motors, [25.0], ["PI:0,7"])

    assert entry["stable_probability"] == 0.75
    assert entry["statement"].startswith("unstable in 25 % of 4 draws; times")
    assert entry["settling_time_s"]["defined_fraction"] == 0.75
    assert entry["settling_time_s"]["sd"] == pytest.approx(0, abs=1e-12)


def test_values_without_a_definition_are_left_out_and_counted() -> None:
    """Two of five values are undefined, then three of five, the majority."""
    most = quantity(np.array([1.0, 2.0, 3.0, np.nan, np.nan]), "s")
    few = quantity(np.array([1.0, 2.0, np.nan, np.nan, np.nan]), "s")

    assert (most["mean"], most["median"], most["defined_fraction"]) == (2.0, 2.0, 0.6)
    assert (few["mean"], few["median"], few["defined_fraction"]) == (None, None, 0.4)


def test_infinite_values_are_the_largest_and_shown_as_null() -> None:
    """For 1 to 9 and one infinity, the median is 5.5, and the 95 % quantile is infinite."""
    found = quantity(np.array([np.inf, *np.arange(1.0, 10.0)]), "dB")

    assert found["median"] == 5.5
    assert found["q05"] == pytest.approx(1.45)
    assert found["q95"] is found["mean"] is found["sd"] is None
    assert found["infinite_fraction"] == pytest.approx(0.1)
    assert found["defined_fraction"] == 1


def test_infinite_margins_are_null_with_their_fraction() -> None:
    """Two poles never reach 180 degrees; at 125 degC the loop gain of 0.66 is below 1."""
    (hot,) = feedback_metrics(PAPER, [125.0], ["P:1"])

    for name in ("gain_margin_db", "phase_margin_deg"):
        assert hot[name]["median"] is None
        assert (hot[name]["infinite_fraction"], hot[name]["defined_fraction"]) == (1, 1)


@pytest.mark.parametrize(
    ("temperatures", "controllers", "message"),
    [
        ([], ["P:1"], "no temperature given"),
        ([float("nan")], ["P:1"], "temperature is nan degC"),
        ([1e6], ["P:1"], r"temperature is 1e\+06 degC; expected -273.15 to"),
        ([25.0], [], "no controller given"),
        ([25.0], ["P:1", "I:2"], "controller 'I:2' is of unknown type"),
    ],
)
def test_options_that_make_no_loop_are_refused(
    temperatures: list[float], controllers: list[str], message: str
) -> None:
    """Each message contains the value and the expected range or form."""
    with pytest.raises(OptionError, match=message):
        feedback_metrics(PAPER, temperatures, controllers)


def test_thousand_draws_at_two_temperatures_take_seconds() -> None:
    """Three controllers take 0.3 s; ten times that would mean a loss of vectorisation."""
    motors = draws(1000)
    feedback_metrics(PAPER, [25.0], ["P:1"])

    begin = time.process_time()
    feedback_metrics(motors, [25.0, 125.0], ["P:1", "PI:1,2", "PID:1,2,0.1"])

    assert time.process_time() - begin < 4
