"""Result of a fit as shown on its page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.fits.schemas import FitSummary
from app.pages.rendering import STATIC_FILES
from app.pages.results import result_view
from app.pages.views import fit_view
from identification.reporting.figures.chart import Line, chart
from identification.reporting.figures.drawn import drawn_chart
from identification.reporting.html import render_report
from identification.reporting.page import page_environment
from tests.reports import make_report

DATA = make_report(with_effect=True)
RESULT: dict[str, Any] = dict(DATA.result)
REPORT = render_report(DATA)
TIME = np.linspace(0.0, 1.0, 5)


def test_story_names_the_effect_the_quality_and_the_parameters() -> None:
    """The campaign lacks Coulomb friction; the story is that of the report's first screen."""
    story = result_view(RESULT, REPORT)["story"]

    assert len(story) == 3
    assert "Coulomb friction" in story[0]
    assert "validation runs" in story[1]
    assert "determine" in story[2]


def test_parameters_of_the_motor_and_of_its_effects_are_listed() -> None:
    """The seven nominal parameters come first, then those of the effect."""
    shown = result_view(RESULT, REPORT)

    names = [row.name for row in shown["parameters"]]
    [effect] = RESULT["effects"]
    assert names[:7] == ["Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L"]
    assert names[7:] == list(effect["parameters"])
    assert shown["has_before"]


def test_metrics_of_the_controller_that_suits_the_motor_come_first() -> None:
    """The key figures refer to this controller, so its table is on the page, too."""
    suited = [{**entry, "controller": "PI:2,10"} for entry in RESULT["feedback"]]

    tables = result_view({**RESULT, "feedback_suited": suited}, REPORT)["feedback"]

    assert [table.controller for table in tables][:2] == ["PI:2,10", "P:1"]


def test_figures_are_those_of_the_report() -> None:
    """Without a readable report the page has its tables and no figures."""
    whole, without = result_view(RESULT, REPORT), result_view(RESULT, "")

    assert whole["evidence"]
    assert whole["steps"]
    assert (without["evidence"], without["steps"]) == ([], [])
    assert without["errors"] == whole["errors"]


def test_every_mark_of_a_figure_has_a_style() -> None:
    """Each class of a figure on the page appears in its style sheet."""
    shown = result_view(RESULT, REPORT)
    sheet = Path(STATIC_FILES, "result.css").read_text(encoding="utf-8")
    figures = "".join(one.svg for one in (*shown["evidence"], *shown["steps"]))

    used = {name for names in re.findall(r'class="([^"]+)"', figures) for name in names.split()}

    styled = set(re.findall(r"\.([a-z][a-z0-9]*)", sheet))
    assert used - styled <= {"after"}, "the line of the final model has the default colour"
    assert used


def test_key_of_a_chart_wraps_and_has_the_colours_of_its_series() -> None:
    """Five temperatures with their simulation need several rows; no label is cut."""
    kinds = [f"heat{i}" for i in range(5)]
    lines = [Line(f"{25 * i} °C with effects", kind, TIME, TIME) for i, kind in enumerate(kinds)]
    drawn = drawn_chart(chart("Step", "Five.", ("time [s]", "speed"), lines))
    sheet = Path(STATIC_FILES, "result.css").read_text(encoding="utf-8")

    keys = re.findall(r'<text class="tick strong (\w+)" x="([\d.]+)" y="([\d.]+)">', drawn)

    assert [kind for kind, _, _ in keys] == kinds
    assert len({y for _, _, y in keys}) > 1
    # 7 units are the average width of a bold letter of 11 units.
    assert all(float(x) + 7.0 * len("— 100 °C with effects") < 460.0 for _, x, _ in keys)
    for kind in (*kinds, "before", "after", "measured", "voltage", "loud"):
        assert f"svg text.{kind}" in sheet


@pytest.mark.parametrize(
    ("severity", "tone"), [("critical", "bad"), ("warning", "fair"), ("note", "plain")]
)
def test_warning_has_the_tone_of_its_severity(severity: str, tone: str) -> None:
    """Notes are separate from the warnings that limit the result."""
    details = [{"code": "x", "severity": severity, "fix": ""}]

    shown = result_view(RESULT | {"warnings": ["text"], "warning_details": details}, "")

    assert [(item.message, item.code) for item in shown["warnings"][tone]] == [("Text", "x")]


def test_notes_have_the_same_name_on_the_page_as_in_the_report() -> None:
    """The report writes "Notes on the runs"; the page of the fit counts them."""
    details = [{"code": "x", "severity": "note", "fix": ""}]
    result = RESULT | {"warnings": ["text"], "warning_details": details}
    fit = FitSummary.model_validate(FitSummary.model_json_schema()["examples"][0])
    links = {"self": "/fit", "report": "/report"}

    page = page_environment("app.pages").get_template("fit.html.j2")
    shown = page.render(
        fit=fit_view(fit.model_copy(update={"links": links}), {}), outcome=result_view(result, ""),
        caller=None, help="", contradictions=(), first_run="", exports={},
    )  # fmt: skip

    assert "<summary>1 note on the runs</summary>" in shown


def test_result_with_few_members_is_shown_with_remarks() -> None:
    """A part that cannot be computed is replaced by a sentence."""
    shown = result_view({"schema_version": 1, "parameters": {}, "warnings": ["a"]}, "")

    assert shown["parameters"] == []
    assert [item.message for item in shown["warnings"]["fair"]] == ["A"]
    assert any("table of parameters" in remark for remark in shown["remarks"])
