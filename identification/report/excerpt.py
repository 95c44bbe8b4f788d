"""Figures of a finished report, for another page that shows the result.

    for figure in report_figures(text, "missing"):
        figure.svg, figure.caption

A report contains text of strangers and runs in a sandbox.  An excerpt does not, so it passes only
the elements and attributes that `identification.report.svg` writes.
"""

from __future__ import annotations

import html
import re
from dataclasses import dataclass
from typing import Final
from xml.etree import ElementTree

from markupsafe import Markup

__all__ = ["ReportFigure", "report_figures"]

_SECTION: Final = '<section id="{}">(.*?)</section>'
_FIGURE: Final = re.compile(
    r'<figure(?: class="(?P<kind>[a-z ]*)")?>\s*(?P<svg><svg .*?</svg>)\s*'
    r"<figcaption>(?P<caption>.*?)</figcaption>",
    re.DOTALL,
)
_ELEMENTS: Final = frozenset({"svg", "title", "desc", "g", "path", "rect", "text"})
_ATTRIBUTES: Final = frozenset(
    {"viewBox", "role", "class", "d", "x", "y", "width", "height", "transform"}
)
_IDENTIFIERS: Final = frozenset({"id", "aria-labelledby"})


@dataclass(frozen=True)
class ReportFigure:
    """One figure of a report.

    Args:
        svg: SVG element; its classes are those of the style sheet of the report.
        caption: Caption as text.
        is_wide: Whether the figure has the width of the page.
    """

    svg: Markup
    caption: str
    is_wide: bool


def report_figures(text: str, section: str) -> list[ReportFigure]:
    """Figures of one section of a report, in their order.

    Args:
        text: The report.
        section: Id of the section: ``missing`` for the evidence of the effects, ``loop`` for the
            step responses.

    Returns:
        The figures; empty if the report has no such section, or a figure has other content.
    """
    found = re.search(_SECTION.format(re.escape(section)), text, re.DOTALL)
    matches = _FIGURE.finditer(found.group(1)) if found else ()
    return [
        ReportFigure(svg, html.unescape(match["caption"]), match["kind"] == "wide")
        for match in matches
        if (svg := _admitted(match["svg"])) is not None
    ]


def _admitted(text: str) -> Markup | None:
    """SVG element with identifiers of its own; None if it is not one that this package draws."""
    if "<!" in text or "<?" in text:
        return None
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return None
    for element in root.iter():
        names = set(element.keys())
        if element.tag not in _ELEMENTS or not names <= _ATTRIBUTES | _IDENTIFIERS:
            return None
        for name in _IDENTIFIERS & names:
            # Figures drawn for the other page count their identifiers from 1 as well.
            own = [f"report-{one}" for one in element.get(name, "").split()]
            element.set(name, " ".join(own))
    return Markup(ElementTree.tostring(root, encoding="unicode"))  # noqa: S704  admitted above
