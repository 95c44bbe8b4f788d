"""Markdown page of the stress tests, with one section per module.

A section is replaced as a whole; text above the sections and sections of other names are kept.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from benchmarks.torture.outcome import Outcome

__all__ = ["section", "with_section"]

_TITLE = "# Stress tests of the service\n\n`make torture` runs all sections.\n"
_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)


def section(name: str, outcomes: Sequence[Outcome], *, short: bool, seconds: float) -> str:
    """Section of a module, including its heading.

    Args:
        name: The module.
        outcomes: Outcomes of its tests.
        short: Whether the short version was run.
        seconds: Duration [s].
    """
    command = f"python -m benchmarks.torture --only {name}{' --short' if short else ''}"
    took = f"{seconds / 60:.0f} minutes" if seconds >= 90 else f"{seconds:.0f} s"
    lines = [
        f"## {name}",
        "",
        f"Made by `{command}` in {took}.",
        "",
        "| test | requirement | measured | result |",
        "|---|---|---|---|",
    ]
    for outcome in outcomes:
        cells = (outcome.test, outcome.asked, outcome.measured)
        verdict = "pass" if outcome.passed else "**fail**"
        lines.append(f"| {' | '.join(map(_cell, cells))} | {verdict} |")
    return "\n".join(lines) + "\n"


def with_section(text: str, name: str, words: str, order: Sequence[str]) -> str:
    """Page with the section of a module replaced, or inserted in order.

    Args:
        text: Previous content; may be empty.
        name: The module.
        words: New section.
        order: All modules in their order; sections of other names come last.
    """
    heads = list(_HEADING.finditer(text))
    bounds = [*(head.start() for head in heads), len(text)]
    parts = {
        head.group(1): text[start:end]
        for head, start, end in zip(heads, bounds[:-1], bounds[1:], strict=True)
    }
    parts[name] = words
    top = text[: heads[0].start()] if heads else text or _TITLE
    places = {module: place for place, module in enumerate(order)}
    chosen = sorted(parts, key=lambda part: places.get(part, len(order)))
    return "\n".join(part.strip() + "\n" for part in (top, *(parts[c] for c in chosen)))


def _cell(text: str) -> str:
    """Text of a table cell on one line, with bars escaped."""
    return " ".join(text.replace("|", r"\|").split())
