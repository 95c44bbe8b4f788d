"""Charts of a report as another page shows them."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from identification.reporting.figures.chart import Band, Line, chart
from identification.reporting.figures.drawn import report_figures
from identification.reporting.html import render_report
from tests.reports import make_report

REPORT = render_report(make_report(with_effect=True))
TIME = np.linspace(0.0, 1.0, 5)
STEP = chart(
    "Step response",
    "It settles at 1.",
    ("time [s]", "speed / reference"),
    [Line("25 <b> degC", "heat0", TIME, TIME), Line("logged", "measured", TIME, TIME, "bars")],
    [Band("heat0", TIME, TIME - 0.1, TIME + 0.1)],
)


def page(element: str) -> str:
    """Report with one figure in its section of the loop."""
    caption = "<figcaption>Step &lt;P&gt;</figcaption>"
    return f'<section id="loop"><figure>{element}{caption}</figure></section>'


@pytest.mark.parametrize("section", ["missing", "temperature", "loop"])
def test_every_chart_of_a_section_is_drawn(section: str) -> None:
    """The section of the report has as many charts in figures as the excerpt."""
    part = re.search(f'<section id="{section}">.*?</section>', REPORT, re.DOTALL)
    assert part
    charts = part[0].count('<div class="chart"')

    assert charts > 0
    assert len(report_figures(REPORT, section)) == charts


def test_drawing_has_lines_bands_and_bars_in_the_colours_of_their_series() -> None:
    """A line at 25 degC is in the coldest colour; a histogram has a bar for each count above 0."""
    [figure] = report_figures(page(STEP), "loop")
    classes = [one.get("class") for one in ElementTree.fromstring(figure.svg).iter("path")]

    assert classes.count("line heat0") == 1
    assert classes.count("band heat0") == 1
    assert classes.count("bars") == 4


def test_caption_is_text_and_a_missing_section_is_empty() -> None:
    """The caption is unescaped once; the template of the page escapes it again."""
    [figure] = report_figures(page(STEP), "loop")

    assert figure.caption == "Step <P>"
    assert report_figures(page(STEP), "missing") == []


@pytest.mark.parametrize(
    ("written", "forged"),
    [
        ('"kind":"heat0"', '"kind":"\\"><script>alert(1)</script>"'),
        ('"kind":"heat0"', '"kind":"a onload=alert(1)"'),
        ("[0.0,", '["<svg>",'),
        ('"bands":[', '"bands":[{},'),
        ('"lines":[', '"lines":["x",'),
        ('"height":230', '"height":"tall"'),
        ("{", "{{"),
    ],
)
def test_forged_data_are_not_drawn(written: str, forged: str) -> None:
    """Only numbers, names of colours and escaped text leave the sandbox of a report."""
    element = STEP.replace(written, forged, 1)

    assert element != STEP
    assert report_figures(page(element), "loop") == []


def test_markup_in_a_label_is_text() -> None:
    """The label `25 <b> degC` is shown as it was written."""
    [figure] = report_figures(page(STEP), "loop")
    words = [one.text for one in ElementTree.fromstring(figure.svg).iter("text")]

    assert "— 25 <b> degC" in words
