"""Options of a fit in the fields of the form on the start page."""

from __future__ import annotations

import pytest

from app.errors import FieldRefused
from app.fits.schemas import FitOptionsIn
from app.pages.choice import options_from, prospects_view
from identification.known import known_values

FIELDS = {
    "posterior": "on", "effects": "on", "hold": "auto", "effort": "normal", "contradicting": "",
    "temperatures": "25, 125", "controllers": "P:1", "known": "", "nameplate": "", "seed": "0",
}  # fmt: skip


def test_form_as_shown_has_the_default_options() -> None:
    """The page shows the defaults of the interface."""
    assert FitOptionsIn.model_validate(options_from(FIELDS)) == FitOptionsIn()


def test_box_without_a_mark_is_no() -> None:
    """A browser does not send an empty check box."""
    form = {name: text for name, text in FIELDS.items() if name not in ("posterior", "effects")}

    options = options_from(form)

    assert (options["posterior"], options["effects"]) == (False, False)


@pytest.mark.parametrize(
    "text",
    [
        "Kt25=0.048+-5% L=2.9e-3",
        "Kt25 = 0.048 +- 5 %, L = 2.9e-3",
        "  Kt25=0.048 ± 5 % ;L=2.9e-3\n",
        "Kt25=0.048+-5%; L=2.9e-3",
    ],
)
def test_known_values_may_have_blanks_around_their_signs(text: str) -> None:
    """Blanks around = and +- do not split a value."""
    words = options_from(FIELDS | {"known": text})["known"]

    assert known_values(words) == known_values(["Kt25=0.048+-5%", "L=2.9e-3"])


def test_controllers_are_separated_by_blanks_or_semicolons() -> None:
    """A comma separates the gains of one controller."""
    options = options_from(FIELDS | {"controllers": "P:1; PI:2,0.5 PID:1,2,3"})

    assert options["controllers"] == ["P:1", "PI:2,0.5", "PID:1,2,3"]


def test_temperature_that_is_no_number_is_named() -> None:
    """The message has the field and the value."""
    with pytest.raises(FieldRefused, match="temperatures: 'hot' is not a number"):
        options_from(FIELDS | {"temperatures": "25, hot"})


def test_precision_of_a_coefficient_near_zero_is_in_its_unit() -> None:
    """1.645 standard deviations of 4e-4 1/K are 6.6e-4 1/K, and of 0.1 ohm 16 % of 1 ohm."""
    entry = {"identified": True, "advice": ""}
    found = {
        "parameters": {
            "Ra25": entry | {"value": 1.0, "expected_sd": 0.1, "unit": "ohm"},
            "alpha_Kt": entry | {"value": -7.6e-5, "expected_sd": 4e-4, "unit": "1/K"},
        },
        "errors": [], "findings": [], "notes": [],
    }  # fmt: skip
    shown = prospects_view(found, 1)["parameters"]
    assert [one["precision"] for one in shown] == ["± 16 %", "± 6.6 ×10⁻⁴"]


def test_contradiction_of_the_chosen_runs_has_its_correction() -> None:
    """The correction is in the fields of the mapping, as on the page of a refused fit."""
    finding = {
        "code": "scaled_channel", "severity": "refuse", "file": "a.csv", "column": "speed_rad_s",
        "message": "the values are probably in rpm",
        "corrections": ["a.csv:speed_rad_s=n * 0.10471975512"],
    }  # fmt: skip
    found = {"parameters": {}, "errors": [], "findings": [finding], "notes": []}

    (shown,) = prospects_view(found, 2)["findings"]

    assert shown["text"] == "Speed: the values are probably in rpm"
    assert shown["corrections"] == ["speed from column n, sign +, factor 0.10471975512"]
