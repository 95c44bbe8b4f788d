"""Header rows read column by column: names, unit, and what the two say together."""

from __future__ import annotations

from dataclasses import dataclass

from identification.ingest.display import plain
from identification.ingest.names import is_units_row, read_header, unbracketed
from identification.ingest.units import Unit, find_unit

__all__ = ["Column", "read_columns"]

# What loggers put into a units row where there is no unit.
_NO_UNIT = ("", "-", "--", "1", "none", "n/a")


@dataclass(frozen=True)
class Column:
    """One column of a table, as its header rows describe it.

    Args:
        index: Position in the table, from 0.
        texts: Its cells in the rows of names, from top to bottom, blank ones left out.
        quantities: What its names may stand for; several where the unit has to decide.
        unit_texts: Units as written: in the name, in the units row; at most one of each.
        canonical: Its canonical channel name, where the header is exactly that.
    """

    index: int
    texts: tuple[str, ...]
    quantities: frozenset[str]
    unit_texts: tuple[str, ...]
    canonical: str | None = None

    @property
    def title(self) -> str:
        """What messages and mappings call the column."""
        return self.texts[0] if self.texts else f"column {self.index + 1}"

    @property
    def label(self) -> str:
        """The title, fit for one line of a message."""
        return plain(self.title)

    @property
    def unit(self) -> Unit | None:
        """Its unit, or None where it has none that is in the table and undisputed."""
        units = {find_unit(text) for text in self.unit_texts}
        return units.pop() if len(units) == 1 else None

    @property
    def has_disputed_unit(self) -> bool:
        """Whether the name and the units row give different units."""
        return len({find_unit(text) for text in self.unit_texts}) > 1

    def is_called(self, title: str) -> bool:
        """Whether a mapping that says `title` means this column."""
        wanted = " ".join(title.split())
        return any(" ".join(text.split()) == wanted for text in (*self.texts, self.title))


def read_columns(header: tuple[tuple[str, ...], ...]) -> list[Column]:
    """Read the header rows of a table.

    A row of units is one below the first in which most cells are units; all others are rows of
    names, such as a long and a short one.

    Args:
        header: Header rows from top to bottom, all of the same number of cells.

    Returns:
        The columns from left to right.
    """
    names = [row for at, row in enumerate(header) if at == 0 or not is_units_row(row)]
    units = [row for at, row in enumerate(header) if at > 0 and is_units_row(row)]
    return [_column(index, names, units) for index in range(len(header[0]))]


def _column(index: int, names: list[tuple[str, ...]], units: list[tuple[str, ...]]) -> Column:
    texts = tuple(dict.fromkeys(row[index].strip() for row in names if row[index].strip()))
    said = [read_header(text) for text in texts]
    named = [header for header in said if header.quantities]
    quantities = frozenset.intersection(*(h.quantities for h in named)) if named else frozenset()
    written = [header.unit_text for header in said if header.unit_text]
    below = [unbracketed(row[index].strip()) for row in units]
    unit_texts = dict.fromkeys([*written, *(u for u in below if u.casefold() not in _NO_UNIT)])
    column = Column(
        index=index,
        texts=texts,
        quantities=quantities,
        unit_texts=tuple(unit_texts),
        canonical=next((header.canonical for header in said if header.canonical), None),
    )
    return _decided_by_unit(column)


def _decided_by_unit(column: Column) -> Column:
    """A name that may be two quantities is the one that its unit measures."""
    unit = column.unit
    if unit is None or unit.quantity not in column.quantities or len(column.quantities) == 1:
        return column
    return Column(
        column.index,
        column.texts,
        frozenset({unit.quantity}),
        column.unit_texts,
        column.canonical,
    )
