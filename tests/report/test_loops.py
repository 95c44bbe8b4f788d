"""The closed loop before and after, side by side."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from identification.report.loops import loop_comparisons, metric_text
from tests.reports import make_report


@pytest.fixture
def result() -> dict[str, Any]:
    """The result of a motor with friction, free to be changed."""
    copied: dict[str, Any] = copy.deepcopy(dict(make_report(rows=300, with_effect=True).result))
    return copied


def test_each_temperature_has_a_column_for_each_way_of_telling(result: dict[str, Any]) -> None:
    """Declared, final and simulated, at 25 and 125 degC: six cells a metric."""
    (comparison,) = loop_comparisons(result)

    assert comparison.temperatures == ("25 °C", "125 °C")
    assert comparison.ways == ("nominal model", "final model", "final model, effects simulated")
    assert {len(cells) for _, _, cells in comparison.rows} == {6}
    assert comparison.rows[0][0] == "Rise time, 10–90 %"


def test_the_step_of_the_simulation_is_stated(result: dict[str, Any]) -> None:
    """28 rad/s, as the made-up result has it."""
    (comparison,) = loop_comparisons(result)

    assert "28 rad/s" in comparison.remark
    assert "coulomb friction" in comparison.remark


def test_a_clean_motor_has_nothing_to_compare(result: dict[str, Any]) -> None:
    """One way of telling needs one table, not a comparison."""
    result["feedback_before"] = []
    result["feedback_nonlinear"] = []

    assert loop_comparisons(result) == []


def test_effects_of_the_log_leave_two_columns(result: dict[str, Any]) -> None:
    """Declared and final model differ, and there is nothing to simulate."""
    result["feedback_nonlinear"] = []

    (comparison,) = loop_comparisons(result)

    assert comparison.ways == ("nominal model", "final model")
    assert comparison.remark == ""


def test_margin_that_no_gain_uses_up_is_infinite_and_no_dash() -> None:
    """As the command line says it; a metric that does not exist has no infinite draws."""
    nothing = {"median": None, "q05": None, "q95": None}

    assert metric_text(nothing | {"infinite_fraction": 1.0}).median == "infinite"
    assert metric_text(nothing | {"infinite_fraction": 0.2}).median == "–"
    assert metric_text(nothing).median == "–"
