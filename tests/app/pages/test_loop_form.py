"""Form of the speed loop."""

from __future__ import annotations

import pytest

from app.errors import FieldRefused
from app.pages.forms import DesignForm, LoopForm, TuningForm
from identification.errors import OptionError

RESULT = {
    "feedback": [
        {"controller": controller, "temperature_degC": temperature}
        for controller in ("PI:2,0.5", "P:1")
        for temperature in (25.0, 125.0)
    ]
}


def test_empty_address_shows_the_first_controller_of_the_fit() -> None:
    """The temperatures are those of the fit, each once."""
    form = LoopForm.of({}, RESULT)

    assert form.controller == "PI:2,0.5"
    assert form.temperatures == [25.0, 125.0]


@pytest.mark.parametrize(
    ("kind", "controller"), [("P", "P:3"), ("PI", "PI:3,4"), ("PID", "PID:3,4,5")]
)
def test_controller_has_the_gains_of_its_kind(kind: str, controller: str) -> None:
    """A hidden field of another kind does not enter."""
    given = {"kind": kind, "kp": " 3 ", "ki": "4", "kd": "5"}

    assert LoopForm.of(given, {}).controller == controller


@pytest.mark.parametrize("text", ["25, 80", "25;80", " 25 80 80 "])
def test_temperatures_may_be_separated_in_any_usual_way(text: str) -> None:
    """A repeated temperature is computed once."""
    assert LoopForm.of({"temperature": text}, {}).temperatures == [25.0, 80.0]


@pytest.mark.parametrize(
    ("text", "reason"), [("warm", "'warm' are not numbers"), ("1 2 3 4 5 6", "6 temperatures")]
)
def test_refused_temperatures_are_shown_with_what_was_expected(text: str, reason: str) -> None:
    """The message contains the text and an example, or the limit."""
    with pytest.raises(OptionError, match=reason):
        _ = LoopForm.of({"temperature": text}, {}).temperatures


def test_default_specification_asks_for_a_speed() -> None:
    """Twice the 15.3 ms of the report's PI controller at its slower temperature are 31 ms."""
    suited = [{"rise_time_s": {"median": time}} for time in (0.0132, 0.0153, None)]
    assert TuningForm.of({}, {"feedback_suited": suited}).values["rise_time"] == "0.031"
    assert TuningForm.of({}, {"feedback_suited": []}).values["rise_time"] == ""
    assert TuningForm.of({"overshoot": "5"}, {"feedback_suited": suited}).values["rise_time"] == ""


def test_a_decimal_comma_is_answered_with_the_decimal_point() -> None:
    """A comma separates numbers in other fields, so it is not read as a decimal sign."""
    with pytest.raises(FieldRefused, match="'2,5' is not a number; write 2.5$"):
        _ = DesignForm(duration="2,5").options
    with pytest.raises(OptionError, match="rise time '0,05' is not a number; write 0.05$"):
        TuningForm.of({"rise_time": "0,05"}, {}).options()
    with pytest.raises(FieldRefused, match="'1,2,3' is not a number$"):
        _ = DesignForm(duration="1,2,3").options
