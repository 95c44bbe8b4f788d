"""Column descriptions: names, quantity and unit of each column from its header rows."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from identification.ingest.display import plain
from identification.ingest.names import is_units_row, read_header, unbracketed
from identification.ingest.units import Unit, find_unit

__all__ = ["Column", "describe_column", "read_columns"]

# Entries of a units row that mean no unit.
_NO_UNIT = ("", "-", "--", "1", "none", "n/a")


@dataclass(frozen=True)
class Column:
    """One column of a table as described by its header rows."""

    index: int
    """Position in the table, counted from 0."""
    texts: tuple[str, ...]
    """Non-blank cells of its name rows, from top to bottom."""
    quantities: frozenset[str]
    """Quantities that its names may stand for; if several, the unit decides."""
    unit_texts: tuple[str, ...]
    """Units as written in the names and in the units rows, without duplicates."""
    canonical: str | None = None
    """Canonical channel name if the header is exactly that name."""

    @property
    def title(self) -> str:
        """Name of the column in messages and mappings."""
        return self.texts[0] if self.texts else f"column {self.index + 1}"

    @property
    def label(self) -> str:
        """Title, sanitised for one line of a message."""
        return plain(self.title)

    @property
    def unit(self) -> Unit | None:
        """Unit, or None if it is missing, unknown or contradictory."""
        units = {find_unit(text) for text in self.unit_texts}
        return units.pop() if len(units) == 1 else None

    @property
    def has_contradictory_units(self) -> bool:
        """True if the name and the units row give different units."""
        return len({find_unit(text) for text in self.unit_texts}) > 1

    def has_name(self, title: str) -> bool:
        """Return True if `title` in a mapping refers to this column."""
        wanted = " ".join(title.split())
        return any(" ".join(text.split()) == wanted for text in (*self.texts, self.title))


def read_columns(header: tuple[tuple[str, ...], ...]) -> list[Column]:
    """Describe the columns of a table from its header rows, top to bottom and equally long.

    A header row below the first is a units row if at least half of its filled cells are units.  All
    other rows hold names, such as a long and a short one.
    """
    names = [row for at, row in enumerate(header) if at == 0 or not is_units_row(row)]
    units = [row for at, row in enumerate(header) if at > 0 and is_units_row(row)]
    return [
        describe_column(index, [row[index] for row in names], [row[index] for row in units])
        for index in range(len(header[0]))
    ]


def describe_column(index: int, names: Sequence[str], units: Sequence[str] = ()) -> Column:
    """Describe one column; its unit decides between the quantities that its names may stand for.

    A column has names, such as a long and a short one, which may contain a unit, and units where
    the file gives them apart from the names.
    """
    texts = tuple(dict.fromkeys(name.strip() for name in names if name.strip()))
    parsed = [read_header(text) for text in texts]
    named = [header for header in parsed if header.quantities]
    quantities = frozenset.intersection(*(h.quantities for h in named)) if named else frozenset()
    written = [header.unit_text for header in parsed if header.unit_text]
    below = [unbracketed(unit.strip()) for unit in units]
    unit_texts = dict.fromkeys([*written, *(u for u in below if u.casefold() not in _NO_UNIT)])
    canonical = next((header.canonical for header in parsed if header.canonical), None)
    column = Column(index, texts, quantities, tuple(unit_texts), canonical)
    unit = column.unit
    if unit is None or unit.quantity not in quantities:
        return column
    return dataclasses.replace(column, quantities=frozenset({unit.quantity}))
