"""Warnings of a result, grouped by severity, with remedies and codes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from identification.result.entries import Entry
from identification.result.numbers import with_symbols

__all__ = ["WarningItem", "Warnings", "warning_groups"]

_TITLES: Final = {
    "critical": "Do not rely on this result",
    "warning": "Parts of the result are biased, uncertain or incomplete",
    "note": "Notes on the runs and on the origin of values",
}
"""Headings of the groups of warnings by severity, most important first."""


class WarningItem(NamedTuple):
    """One warning; the remedies and the code may be empty."""

    message: str
    """Description without the remedy."""
    fix: str
    """Remedy with the options of the command line."""
    service: str
    """Field of the form and option of a request for the same remedy."""
    code: str
    """Identifier, which is a heading of docs/troubleshooting.md."""


@dataclass(frozen=True)
class Warnings:
    """Warnings of one severity."""

    severity: str
    title: str
    items: tuple[WarningItem, ...]


def warning_groups(result: Entry) -> list[Warnings]:
    """Warnings by severity, most important first; without details a warning is a ``warning``."""
    details: Sequence[Entry] = result.get("warning_details") or ()
    found: dict[str, list[WarningItem]] = {severity: [] for severity in _TITLES}
    for place, text in enumerate(map(str, result["warnings"])):
        detail = details[place] if place < len(details) else {}
        severity, fix = str(detail.get("severity", "")), str(detail.get("fix", ""))
        message = text.replace(f"; {fix}", "", 1) if fix else text
        service, code = str(detail.get("fix_http", "")), str(detail.get("code", ""))
        found[severity if severity in found else "warning"].append(
            WarningItem(_written(message), _written(fix), service, code)
        )
    return [
        Warnings(severity, _TITLES[severity], tuple(items))
        for severity, items in found.items()
        if items
    ]


def _written(text: str) -> str:
    """Text with °C, and with a capital unless it begins with a name, an option or a file."""
    text = with_symbols(text)
    first = text.partition(" ")[0]
    return text[:1].upper() + text[1:] if first.isalpha() and first.islower() else text
