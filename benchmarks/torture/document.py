"""The table of the torture tests: a Markdown file with a section for each module.

A section is replaced as a whole; whatever else the file says, above the sections or in sections
that are no module's, stays.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from benchmarks.torture.outcome import Outcome

__all__ = ["section", "with_section"]

_TITLE = "# Torture\n\nWhat the service stands; `make torture` makes all of it anew.\n"
_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)


def section(name: str, outcomes: Sequence[Outcome], *, short: bool, seconds: float) -> str:
    """The section of a module, from its heading on.

    Args:
        name: The module.
        outcomes: What it found.
        short: Whether it had only a minute.
        seconds: How long it took [s].
    """
    command = f"python -m benchmarks.torture --only {name}{' --short' if short else ''}"
    took = f"{seconds / 60:.0f} minutes" if seconds >= 90 else f"{seconds:.0f} s"
    lines = [
        f"## {name}",
        "",
        f"Made by `{command}` in {took}.",
        "",
        "| test | asked | measured | |",
        "|---|---|---|---|",
    ]
    for outcome in outcomes:
        cells = (outcome.test, outcome.asked, outcome.measured)
        verdict = "pass" if outcome.passed else "**fail**"
        lines.append(f"| {' | '.join(map(_cell, cells))} | {verdict} |")
    return "\n".join(lines) + "\n"


def with_section(text: str, name: str, words: str, order: Sequence[str]) -> str:
    """A document with the section of a module replaced, or added where it belongs.

    Args:
        text: The document so far; may be empty.
        name: The module.
        words: Its section.
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
    """Words of a cell: a bar would begin the next one."""
    return " ".join(text.replace("|", r"\|").split())
