"""The plain words of a report: they must not say more than the numbers."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from identification.report.summary import key_figures, summary_sentences
from identification.report.tables import error_rows, feedback_tables, parameter_rows, run_rows
from tests.reports import make_report


@pytest.fixture
def result() -> dict[str, Any]:
    """The result of the clean motor, free to be changed."""
    copied: dict[str, Any] = copy.deepcopy(dict(make_report(rows=300).result))
    return copied


def with_ratio(result: dict[str, Any], ratio: float, role: str = "validation") -> dict[str, Any]:
    """The result with another noise ratio of the current."""
    result["errors"]["after"][role]["current"]["noise_ratio"] = ratio
    return result


@pytest.mark.parametrize(
    ("ratio", "verdict", "tone"),
    [
        (1.00, "the residual does not exceed the sensor noise", "good"),
        (1.06, "a small part of the residual exceeds the sensor noise", "fair"),
        (3.00, "the model lacks an effect of the motor or of a sensor", "bad"),
    ],
)
def test_the_verdict_follows_the_noise_ratio(
    result: dict[str, Any], ratio: float, verdict: str, tone: str
) -> None:
    """1.02 is what a complete model may reach on runs it has not seen, 1.1 what is still close."""
    changed = with_ratio(result, ratio)

    assert verdict in " ".join(summary_sentences(changed))
    assert key_figures(changed)[0].tone == tone


def test_a_good_ratio_is_no_praise_when_the_residual_is_not_white(result: dict[str, Any]) -> None:
    """Noise estimated from the residual makes the ratio 1 for any model; colour gives it away."""
    told = " ".join(summary_sentences(result, coloured=["speed"]))

    assert "does not exceed the sensor noise" not in told
    assert "the residual of the speed is not white" in told
    assert key_figures(result, coloured=["speed"])[1].tone == "fair"


def test_runs_that_were_not_fitted_decide(result: dict[str, Any]) -> None:
    """A training error says little; without other runs it is all there is, and is named."""
    with_ratio(result, 7.0, role="training")
    assert "7.00" not in " ".join(summary_sentences(result))

    result["errors"]["after"]["validation"] = None

    assert "On the training runs, the ratio of RMSE to sensor noise is 7.00" in " ".join(
        summary_sentences(result)
    )


def test_parameters_that_are_not_identified_are_named(result: dict[str, Any]) -> None:
    """A number that is no measurement must not pass for one."""
    result["parameters"]["alpha_Kt"]["identified"] = False

    assert "do not determine alpha_Kt" in " ".join(summary_sentences(result))


def test_a_single_temperature_makes_no_sentence_about_hot_and_cold(result: dict[str, Any]) -> None:
    """There is nothing to compare."""
    result["feedback"] = result["feedback"][:1]

    assert "changes the final value" not in " ".join(summary_sentences(result))


def test_a_shift_is_taken_relative_to_the_final_value() -> None:
    """The declared fit of the made-up motor lies 11 % above the final one, in size."""
    rows = {row.name: row for row in parameter_rows(make_report(rows=300, with_effect=True))}

    assert rows["Ra25"].shift == "+11 %"
    assert rows["alpha_Kt"].shift == "−11 %"
    assert rows["torque"].meaning == "of coulomb_friction"
    assert rows["torque"].before is None


def test_columns_of_feedback_go_from_cold_to_hot(result: dict[str, Any]) -> None:
    """Whatever order the user gave."""
    result["feedback"].reverse()

    (table,) = feedback_tables(result["feedback"])

    assert table.temperatures == ("25 °C", "125 °C")
    assert table.rows[0][0] == "Rise time, 10–90 %"


def test_errors_of_a_role_without_runs_have_no_row(result: dict[str, Any]) -> None:
    """Null in the result, nothing in the table."""
    result["errors"]["after"]["validation"] = None

    assert {row.role for row in error_rows(result)} == {"training"}


def test_a_run_is_rated_by_the_noise_it_was_made_with() -> None:
    """The simulation is exact, so error over noise is 1 and the residual is white."""
    for row in run_rows(make_report(rows=4000)):
        assert float(row.current[1]) == pytest.approx(1.0, abs=0.06)
        assert float(row.speed[1]) == pytest.approx(1.0, abs=0.06)
        assert float(row.speed[2].removeprefix("< ")) > 0.001


def test_a_run_that_was_fitted_too_is_no_check(result: dict[str, Any]) -> None:
    """Its errors are those of training, and nothing is said to be unseen."""
    training = [run for run in result["runs"] if run["role"] == "training"]
    copies = [dict(run, role="validation", same_as=k) for k, run in enumerate(training)]

    told = " ".join(summary_sentences(result | {"runs": training + copies}))

    assert "identical to training runs, so there is no independent validation" in told
    assert "not used in the fit" not in told
    assert "On the training runs" in told


def test_one_copy_among_runs_left_out_is_counted(result: dict[str, Any]) -> None:
    """The other run is still one that the model had not seen."""
    training = [run for run in result["runs"] if run["role"] == "training"]
    left_out = [run for run in result["runs"] if run["role"] == "validation"][:1]
    copy = dict(training[0], role="validation", same_as=0)

    told = " ".join(summary_sentences(result | {"runs": [*training, *left_out, copy]}))

    assert "1 of these runs is identical to training runs" in told
    assert "On the validation runs" in told


def spread(result: dict[str, Any], name: str, factor: float) -> None:
    """Have a figure of the loop lie between its median over and times a factor."""
    for entry in result["feedback"]:
        median = entry[name]["median"]
        entry[name] |= {"q05": median / factor, "q95": median * factor}


def test_a_loop_of_a_motor_that_was_not_measured_is_no_prediction(result: dict[str, Any]) -> None:
    """A shaft that never turned: torque constant and inertia are guesses over decades."""
    for name in ("Kt25", "J", "b"):
        result["parameters"][name]["identified"] = False
    spread(result, "rise_time_s", 200.0)
    spread(result, "steady_state", 20.0)

    told = " ".join(summary_sentences(result))

    assert "these runs do not determine the rise time and the final value" in told
    assert "changes the final value" not in told
    assert [f.value for f in key_figures(result)[-2:]] == ["not determined", "not determined"]


def test_what_the_runs_tell_of_a_loop_is_told(result: dict[str, Any]) -> None:
    """Without an inertia the loop settles somewhere after an unknown time."""
    result["parameters"]["J"]["identified"] = False
    spread(result, "rise_time_s", 200.0)

    told = " ".join(summary_sentences(result))

    assert "changes the final value from" in told
    assert "; these runs do not determine the rise time." in told
    assert "the rise time from" not in told


def test_a_loop_that_does_not_need_what_is_unknown_is_told(result: dict[str, Any]) -> None:
    """An inductance too small to be seen changes nothing in the loop."""
    result["parameters"]["L"]["identified"] = False

    told = " ".join(summary_sentences(result))

    assert "changes the final value from" in told
    assert "the rise time from" in told
    assert "these runs do not determine" not in told


@pytest.mark.parametrize("is_used", [True, False])
def test_values_that_were_used_are_named(result: dict[str, Any], is_used: bool) -> None:
    """An interval that a given value made narrow is not the work of the runs alone."""
    for name in ("Kt25", "J"):
        result["parameters"][name]["prior"] = {
            "value": 0.07, "sd": 7e-4, "origin": "--known", "used": is_used,
            "identified_by_runs": True,
        }  # fmt: skip

    words = " ".join(summary_sentences(result))

    assert (
        "The intervals include the given knowledge (known values, nameplate) of Kt25 and J" in words
    ) is is_used
