"""Two fits side by side."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import Any

import pytest

from app.pages.results import comparison_view
from tests.reports import make_report

DATA = make_report(with_effect=True)
FIRST: dict[str, Any] = dict(DATA.result)
STEPS = [step for step in DATA.steps if step.controller == DATA.steps[0].controller]


def moved(name: str, sds: float) -> dict[str, Any]:
    """The first result with one parameter moved by so many combined standard deviations."""
    result = deepcopy(FIRST)
    entry = result["parameters"][name]
    shift = sds * 2**0.5 * entry["sd"]
    for key in ("mean", "q05", "median", "q95"):
        entry[key] += shift
    return result


@pytest.mark.parametrize(("sds", "is_significant"), [(0.5, False), (-8.0, True)])
def test_difference_is_counted_in_combined_standard_deviations(
    sds: float, is_significant: bool
) -> None:
    """Both fits have the same standard deviation; only the inertia moves."""
    rows = {r["name"]: r for r in comparison_view([FIRST, moved("J", sds)], [(), ()])["parameters"]}

    assert rows["J"]["sds"] == f"{sds:+.1f}".replace("-", "−")
    assert rows["J"]["is_significant"] is is_significant
    assert rows["Ra25"]["sds"] == "+0.0"
    assert not rows["Ra25"]["is_significant"]


def test_fits_with_and_without_the_search_for_effects_are_not_tested() -> None:
    """A difference of 8 standard deviations is shown, but not called significant."""
    other = moved("Ra25", 8.0)
    other["options"] = {"effects": False}

    shown = comparison_view([FIRST, other], [STEPS, STEPS])

    (row,) = [row for row in shown["parameters"] if row["name"] == "Ra25"]
    assert not shown["is_tested"]
    assert (row["sds"], row["is_significant"]) == ("+8.0", False)


def test_change_of_a_value_that_may_be_zero_has_no_percentage() -> None:
    """The interval of the friction contains zero in the second fit."""
    second = deepcopy(FIRST)
    second["parameters"]["b"]["q05"] = -1e-9
    rows = {row["name"]: row for row in comparison_view([FIRST, second], [(), ()])["parameters"]}

    assert rows["b"]["relative"] == "–"
    assert rows["J"]["relative"] == "0.00 %"


def test_inductance_has_the_prefix_of_the_other_tables() -> None:
    """Microhenries rather than powers of ten; the larger value selects the prefix of both."""
    rows = {r["name"]: r for r in comparison_view([FIRST, moved("L", 1.0)], [(), ()])["parameters"]}
    median = 1e6 * FIRST["parameters"]["L"]["median"]

    assert rows["L"]["unit"] == "µH"
    assert float(rows["L"]["estimates"][0].median) == pytest.approx(median, rel=1e-2)
    assert rows["L"]["estimates"][0].power == ""
    assert rows["Ra25"]["unit"] == "Ω"


def test_effect_of_one_fit_has_a_dash_in_the_other() -> None:
    """The second fit has no effects, so its columns are empty there."""
    shown = comparison_view([FIRST, FIRST | {"effects": []}], [(), ()])

    [effect] = shown["effects"]
    assert effect["probabilities"][0] != "–"
    assert effect["probabilities"][1] == "–"
    own = [row for row in shown["parameters"] if "." in row["name"]]
    assert own
    assert all(row["estimates"][1] is None for row in own)


def test_shared_training_runs_are_counted() -> None:
    """A fit shares all training runs with itself."""
    training = sum(run["role"] == "training" for run in FIRST["runs"])

    assert comparison_view([FIRST, FIRST], [(), ()])["shared"] == training > 0


def test_step_responses_of_both_fits_are_drawn_over_each_other() -> None:
    """One figure at each temperature, with a line of the first and one of the second fit."""
    slower = [replace(step, time=2.0 * step.time) for step in STEPS]

    shown = comparison_view([FIRST, FIRST], [STEPS, slower])["steps"]

    assert len(shown) == len(STEPS)
    for one in shown:
        assert one["figure"].count('class="line before"') == 1
        assert one["figure"].count('class="line after"') == 1


def test_results_without_parameters_leave_remarks() -> None:
    """Tables that cannot be computed are replaced by sentences."""
    shown = comparison_view([{}, {}], [(), ()])

    assert shown["parameters"] == ()
    assert any("table of parameters" in remark for remark in shown["remarks"])
