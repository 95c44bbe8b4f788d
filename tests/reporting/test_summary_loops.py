"""Sentences and figures of a report on the speed loop."""

from __future__ import annotations

import re
from typing import Any

from identification.reporting.headline import (
    key_figures,
)
from identification.reporting.summary import summary_sentences
from identification.reporting.tables import (
    feedback_tables,
    parameter_rows,
)
from tests.reports import make_report


def test_a_single_temperature_makes_no_sentence_about_hot_and_cold(result: dict[str, Any]) -> None:
    """With one temperature there is no comparison."""
    result["feedback"] = result["feedback"][:1]

    assert "changes the final value" not in " ".join(summary_sentences(result))


def test_a_shift_is_taken_relative_to_the_final_value() -> None:
    """A nominal estimate 11 % above the final one gives a shift of +11 %."""
    rows = {row.name: row for row in parameter_rows(make_report(rows=300, with_effect=True))}

    assert rows["Ra25"].shift == "+11.00 %"
    assert rows["alpha_Kt"].shift == "+11.00 %"
    assert rows["torque"].meaning == "of Coulomb friction"
    assert rows["torque"].before is None


def test_columns_of_feedback_go_from_cold_to_hot(result: dict[str, Any]) -> None:
    """The order of the temperatures in the result does not matter."""
    result["feedback"].reverse()

    (table,) = feedback_tables(result["feedback"])

    assert table.temperatures == ("25 °C", "125 °C")
    assert table.rows[0][0] == "Rise time, 10–90 %"


def spread(result: dict[str, Any], name: str, factor: float) -> None:
    """Set the interval of a loop metric to its median divided and multiplied by a factor."""
    for entry in result["feedback"]:
        median = entry[name]["median"]
        entry[name] |= {"q05": median / factor, "q95": median * factor}


def test_undetermined_loop_metrics_are_not_predicted(result: dict[str, Any]) -> None:
    """If the shaft never turned, Kt and J are unknown by decades."""
    result["feedback_suited"] = []
    for name in ("Kt25", "J", "b"):
        result["parameters"][name]["identified"] = False
    spread(result, "rise_time_s", 200.0)
    spread(result, "steady_state", 20.0)

    told = " ".join(summary_sentences(result))

    assert "these runs do not determine the rise time and the final value" in told
    assert "changes the final value" not in told
    assert [f.value for f in key_figures(result)[-2:]] == ["not determined", "not determined"]


def test_loop_that_is_unstable_when_hot_has_no_final_value_in_the_sentence(
    result: dict[str, Any],
) -> None:
    """Metrics without a median are not written as a dash."""
    hot = max(result["feedback"], key=lambda entry: float(entry["temperature_degC"]))
    hot["stable_probability"] = 0.49
    hot["statement"] = "unstable in 51 % of 1968 draws; times, peak and bandwidth are null"
    for name in ("rise_time_s", "steady_state"):
        hot[name] |= {"mean": None, "sd": None, "q05": None, "median": None, "q95": None}

    (told,) = [one for one in summary_sentences(result) if "unity feedback" in one]

    assert "the loop is unstable in 51 % of 1968 draws at 125 °C, so that no rise time" in told
    assert "–" not in told
    assert "null" not in told


def test_the_controller_that_suits_the_motor_stands_on_the_first_screen(
    result: dict[str, Any],
) -> None:
    """Without it, the figures are those of the first controller of the options."""
    assert [f.label for f in key_figures(result)[1:]] == ["Rise time", "Overshoot"]
    assert "proposed PI:2,40" in key_figures(result)[1].remark

    result["feedback_suited"] = []

    assert [f.label for f in key_figures(result)[1:]] == ["Rise time", "Final value"]
    assert "P:1" in key_figures(result)[1].remark


def test_each_determined_loop_metric_is_reported(result: dict[str, Any]) -> None:
    """Without J the rise time is undetermined, but the final value is reported."""
    result["parameters"]["J"]["identified"] = False
    spread(result, "rise_time_s", 200.0)

    told = " ".join(summary_sentences(result))

    assert "changes the final value from" in told
    assert "; these runs do not determine the rise time." in told
    assert "the rise time from" not in told


def test_cold_loop_is_reported_if_the_hot_one_is_undetermined(result: dict[str, Any]) -> None:
    """Runs of a laboratory determine the loop at 25 degC and not at 125 degC."""
    result["parameters"]["alpha_Ra"]["identified"] = False
    result["feedback_suited"] = []
    hot = result["feedback"][1]["rise_time_s"]
    hot["q95"] = hot["q05"] + 200.0 * hot["median"]

    told, figure = " ".join(summary_sentences(result)), key_figures(result)[1]

    assert "; these runs do not determine the rise time at 125 °C." in told
    assert re.fullmatch(r"[\d.]+ ms", figure.value)
    assert figure.remark == "at 25 °C, P:1; not determined at 125 °C"


def test_an_unknown_without_influence_leaves_the_loop_determined(result: dict[str, Any]) -> None:
    """An inductance too small to be identified does not affect the loop."""
    result["parameters"]["L"]["identified"] = False

    told = " ".join(summary_sentences(result))

    assert "changes the final value from" in told
    assert "the rise time from" in told
    assert "these runs do not determine" not in told


def test_a_short_time_is_written_in_milliseconds(result: dict[str, Any]) -> None:
    """Rise times of 0.72 and 0.58 s share the unit ms; the settling time of 1.28 s stays in s."""
    (table,) = feedback_tables(result["feedback"])
    units = {label: unit for label, unit, _ in table.rows}

    assert units["Rise time, 10–90 %"] == "ms"
    assert units["Settling time, 2 %"] == "s"
