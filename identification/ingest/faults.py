"""Faults of one file, collected so that one error reports all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from identification.errors import RunFileError
from identification.ingest.display import quoted

__all__ = ["Faults", "collected", "refuse_all"]

_SHOWN = 4
"""Further ranges of rows listed for each column and kind of fault."""
_MOST = 10_000
"""Faults after which reading stops; a file with more is not corrected by hand."""


@dataclass
class _Group:
    """Faults of one kind in one column: the first one, and the rows of the others.

    `ranges` holds first row, last row and value of consecutive rows with the same value.
    """

    first: RunFileError
    ranges: list[tuple[int, int, object]] = field(default_factory=list)
    unlisted: int = 0

    def add(self, row: int, value: object) -> None:
        """Count one more row."""
        if self.ranges and self.ranges[-1][1:] == (row - 1, value):
            self.ranges[-1] = (self.ranges[-1][0], row, value)
        elif len(self.ranges) < _SHOWN:
            self.ranges.append((row, row, value))
        else:
            self.unlisted += 1

    def error(self) -> RunFileError:
        """The first error, whose message lists the rows of the others."""
        others = [
            (f"row {first}" if first == last else f"rows {first} to {last}")
            + (f" ({quoted(value)})" if isinstance(value, str) and value else "")
            for first, last, value in self.ranges
        ]
        if others:
            more = f" and {self.unlisted} more" if self.unlisted else ""
            self.first.message += f"; the same in {', '.join(others)}{more}"
            self.ranges = []
        return self.first


class Faults:
    """Faults of one file, grouped by column and kind in the order of their detection.

    Attributes:
        count: Number of faults.
    """

    def __init__(self) -> None:
        self.count = 0
        self._groups: dict[tuple[str, str | None], _Group] = {}

    def add(self, error: RunFileError) -> None:
        """Record a fault with its row, after those of earlier rows of its column.

        Raises:
            RunFileError: The limit is reached; the error reports all faults so far.
        """
        if error.row is None:
            raise error
        self.count += 1
        group = self._groups.get((error.code, error.column))
        if group is None:
            self._groups[error.code, error.column] = _Group(error)
        else:
            group.add(error.row, error.value)
        if self.count >= _MOST:
            self.refuse(f"; reading stopped at row {error.row}, after {_MOST} faults")

    def errors(self) -> list[RunFileError]:
        """First fault of each column and kind; its message lists the rows of the others."""
        return [group.error() for group in self._groups.values()]

    def refuse(self, remark: str = "") -> None:
        """Raise the first fault, with the first ones of the other columns as `further`.

        Raises:
            RunFileError: There are faults.
        """
        errors = self.errors()
        if errors:
            errors[0].message += remark
        refuse_all(errors)


@contextmanager
def collected(errors: list[RunFileError]) -> Iterator[None]:
    """Append an error to a list, so that the other channels are examined too."""
    try:
        yield
    except RunFileError as error:
        # A column with two faults concerns several channels with one message.
        if str(error) not in map(str, errors):
            errors.append(error)


def refuse_all(errors: Sequence[RunFileError]) -> None:
    """Raise the first error, if there is one, with the others as `further`.

    Raises:
        RunFileError: There are errors.
    """
    if errors:
        errors[0].further = tuple(errors[1:])
        raise errors[0]
