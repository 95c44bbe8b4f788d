"""The tables of docs/run-files.md agree with the code."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from identification import errors
from identification.ingest import Limits
from identification.ingest.names import NAMES
from identification.ingest.plausibility import BOUNDS
from identification.ingest.units import CHANNEL_QUANTITIES, FACTOR_QUANTITIES, UNITS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "run-files.md").read_text(encoding="utf-8")


def ticked(texts: Iterable[str]) -> str:
    """Texts in backticks, separated by commas."""
    return ", ".join(f"`{text}`" for text in texts)


def rows(heading: str) -> list[str]:
    """Body rows of the first table of a section."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    table = re.search(r"(?:^\|.*\n)+", section, re.MULTILINE)
    return table[0].splitlines()[2:] if table else []


def test_page_lists_every_unit_with_its_spellings() -> None:
    """The expected rows are built from the table of units."""
    expected = [
        f"| {unit.quantity} | `{unit.name}` | {ticked(unit.spellings[1:])} "
        f"| {unit.factor:.9g} | {unit.shift:g} |"
        for unit in UNITS
    ]

    assert rows("Units") == expected


def test_page_lists_every_name() -> None:
    """The expected rows are built from the table of names."""
    for channel, quantity in (CHANNEL_QUANTITIES | FACTOR_QUANTITIES).items():
        assert f"| `{channel}` | {ticked(NAMES[quantity])} |" in PAGE


def test_page_lists_every_error_with_its_code() -> None:
    """The expected classes are the leaves of the error tree, in its order."""
    expected = [(leaf.__name__, leaf.code) for leaf in errors.RunFileError.__subclasses__()]

    assert [tuple(re.findall(r"`(\w+)`", row)[:2]) for row in rows("Errors")] == expected


def test_page_lists_every_warning() -> None:
    """The expected codes are those in the source files."""
    given = re.compile(r'\.warning\(\s*"(\w+)"|RunWarning\("(\w+)"')
    sources = (ROOT / "identification" / "ingest").rglob("*.py")
    codes = {a or b for path in sources for a, b in given.findall(path.read_text("utf-8"))}

    listed = {re.findall(r"`(\w+)`", row)[0] for row in rows("Warnings")}

    assert listed == codes
    assert len(codes) == len(rows("Warnings"))


def test_page_gives_the_bounds_and_limits() -> None:
    """The expected numbers are those of the table of bounds and of the default limits."""
    for channel, bounds in BOUNDS.items():
        low, high = bounds.possible
        assert f"| `{channel}` | {low:g} to {high:g} | " in PAGE
        peak = f"{bounds.least:g} " if bounds.least else ""
        assert f" | {bounds.usual[0]:g} to {bounds.usual[1]:g} | {peak}|\n" in PAGE
    limits = Limits()
    assert (
        f"{limits.bytes:,} bytes, {limits.rows:,} rows, {limits.columns:,} columns, "
        f"{limits.line_bytes:,} bytes in a line" in PAGE
    )
