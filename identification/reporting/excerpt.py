"""Charts of a finished report, for another page that shows the result.

    for figure in report_figures(text, "missing"):
        figure.svg, figure.caption

A report contains text of strangers and runs in a sandbox.  An excerpt does not, so its charts are
drawn anew from their data.
"""

from __future__ import annotations

import html
import re
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from identification.reporting.figures.drawn import CHART, drawn_chart

__all__ = ["ReportFigure", "report_figures"]

_SECTION: Final = '<section id="{}">(.*?)</section>'
_FIGURE: Final = re.compile(
    rf'<figure(?: class="(?P<kind>[a-z ]*)")?>\s*(?P<chart>{CHART.pattern})\s*'
    r"<figcaption>(?P<caption>.*?)</figcaption>",
    re.DOTALL,
)
_NARROW, _WIDE = 460.0, 920.0


@dataclass(frozen=True)
class ReportFigure:
    """One figure of a report."""

    svg: Markup
    """SVG element; its classes are those of the style sheet of the page."""
    caption: str
    is_wide: bool
    """Whether the figure has the width of the page."""


def report_figures(text: str, section: str) -> list[ReportFigure]:
    """Charts of the section of a report with an id, in their order; empty if it has none.

    The section is ``missing`` for the evidence of the effects, ``summary`` for the first screen,
    ``loop`` for the step responses.  Charts that cannot be drawn are omitted.
    """
    found = re.search(_SECTION.format(re.escape(section)), text, re.DOTALL)
    figures = []
    for match in _FIGURE.finditer(found.group(1)) if found else ():
        is_wide = match["kind"] == "wide"
        try:
            drawn = drawn_chart(match["chart"], _WIDE if is_wide else _NARROW)
        except ValueError:
            continue
        svg = Markup(drawn)  # noqa: S704  text is escaped where it is drawn
        figures.append(ReportFigure(svg, html.unescape(match["caption"]), is_wide))
    return figures
