"""Comparison of the speed loop for the nominal, final and simulated models."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from identification.reporting.loops import loop_comparisons, metric_text, pair_text
from tests.reports import make_report


@pytest.fixture
def result() -> dict[str, Any]:
    """Modifiable result of a motor with friction."""
    copied: dict[str, Any] = copy.deepcopy(dict(make_report(rows=300, with_effect=True).result))
    return copied


def test_each_temperature_has_a_column_for_each_model(result: dict[str, Any]) -> None:
    """Three models at 25 and 125 degC give six cells per metric."""
    (comparison,) = loop_comparisons(result)

    assert comparison["temperatures"] == ("25 °C", "125 °C")
    assert comparison["ways"] == ("nominal model", "final model", "final model, effects simulated")
    assert {len(cells) for _, _, cells in comparison["rows"]} == {6}
    assert comparison["rows"][0][0] == "Rise time, 10–90 %"


def test_the_step_of_the_simulation_is_stated(result: dict[str, Any]) -> None:
    """The remark names the step of 28 rad/s and the simulated effect."""
    (comparison,) = loop_comparisons(result)

    assert "28 rad/s" in comparison["remark"]
    assert "at 25 °C the speed settles" in comparison["remark"]
    assert "Coulomb friction" in comparison["remark"]


def test_a_clean_motor_has_nothing_to_compare(result: dict[str, Any]) -> None:
    """A result with one model only has no comparison table."""
    result["feedback_before"] = []
    result["feedback_nonlinear"] = []

    assert loop_comparisons(result) == []


def test_effects_of_the_log_leave_two_columns(result: dict[str, Any]) -> None:
    """Sensor effects do not change the motor, so only nominal and final model are compared."""
    result["feedback_nonlinear"] = []

    (comparison,) = loop_comparisons(result)

    assert comparison["ways"] == ("nominal model", "final model")
    assert comparison["remark"] == ""


def test_infinite_margin_is_not_shown_as_a_dash() -> None:
    """A margin that is infinite in all draws reads "infinite"; an unknown metric is a dash."""
    nothing = {"median": None, "q05": None, "q95": None}

    assert metric_text(nothing | {"infinite_fraction": 1.0}).median == "infinite"
    assert metric_text(nothing | {"infinite_fraction": 0.2}).median == "–"
    assert metric_text(nothing).median == "–"


def test_a_pair_shows_an_overshoot_of_zero_without_the_digits_of_its_interval() -> None:
    """Most draws overshoot by nothing, a few by a thousandth of a per cent."""
    none = {"median": 0.0, "q05": 0.0, "q95": 2e-4}
    some = {"median": 7.892, "q05": 7.881, "q95": 7.903}

    assert pair_text(none, some, " → ", "%") == "0 → 7.892 %"
