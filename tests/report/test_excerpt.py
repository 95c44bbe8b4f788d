"""Figures of a report as another page shows them."""

from __future__ import annotations

import re

import pytest

from identification.report.excerpt import report_figures
from identification.report.html import render_report
from tests.reports import make_report

REPORT = render_report(make_report(with_effect=True))
SHAPE = '<svg viewBox="0 0 9 9" role="img"><path class="line" d="M0 0h9"/></svg>'


def page(svg: str) -> str:
    """Report with one figure in its section of the loop."""
    caption = "<figcaption>Step &lt;P&gt;</figcaption>"
    return f'<section id="loop"><figure>{svg}{caption}</figure></section>'


@pytest.mark.parametrize("section", ["missing", "temperature", "loop"])
def test_every_figure_of_a_section_is_taken(section: str) -> None:
    """The section of the report has as many SVG elements in figures as the excerpt."""
    part = re.search(f'<section id="{section}">.*?</section>', REPORT, re.DOTALL)
    assert part
    drawn = part[0].count("<figure")

    assert drawn > 0
    assert len(report_figures(REPORT, section)) == drawn


def test_identifiers_differ_from_those_of_newly_drawn_figures() -> None:
    """Every figure refers to its own title by an identifier that begins with `report-`."""
    for figure in report_figures(REPORT, "missing"):
        named = re.findall(r' id="([^"]+)"', figure.svg)

        assert named
        assert all(name.startswith("report-svg") for name in named)
        assert f'aria-labelledby="{" ".join(named)}"' in figure.svg


def test_caption_is_text_and_a_missing_section_is_empty() -> None:
    """The caption is unescaped once; the template of the page escapes it again."""
    [figure] = report_figures(page(SHAPE), "loop")

    assert figure.caption == "Step <P>"
    assert report_figures(page(SHAPE), "missing") == []


@pytest.mark.parametrize(
    "added",
    [
        "<script>alert(1)</script>",
        '<a href="https://example.org"><path class="line" d="M0 0"/></a>',
        '<path class="line" d="M0 0" onload="alert(1)"/>',
        '<path style="fill: url(https://example.org)" d="M0 0"/>',
        "<foreignObject><p>x</p></foreignObject>",
        '<!DOCTYPE x [<!ENTITY a "b">]>',
        "<path",
    ],
)
def test_figure_with_other_content_is_left_out(added: str) -> None:
    """Only elements and attributes of drawn figures reach a page outside the sandbox."""
    assert report_figures(page(SHAPE.replace("<path", f"{added}<path", 1)), "loop") == []
