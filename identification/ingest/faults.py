"""Faults of one file, collected so that one error reports all of them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from identification.errors import RunFileError
from identification.ingest.display import quoted

__all__ = ["Faults", "collected", "refuse_all"]

_Place = tuple[int, object]
"""Row and value of a fault."""
_SHOWN = 4
"""Further ranges of rows listed for each column and kind of fault."""
_MOST = 10_000
"""Faults after which reading stops; a file with more is not corrected by hand."""


class Faults:
    """Faults of one file, grouped by column and kind in the order of their detection."""

    def __init__(self) -> None:
        self._count = 0
        self._groups: dict[tuple[str, str | None], tuple[RunFileError, list[_Place]]] = {}

    def add(self, error: RunFileError) -> None:
        """Record a fault with its row, after those of earlier rows of its column.

        Raises:
            RunFileError: The limit is reached; the error reports all faults so far.
        """
        if error.row is None:
            raise error
        self._count += 1
        first, others = self._groups.setdefault((error.code, error.column), (error, []))
        if first is not error:
            others.append((error.row, error.value))
        if self._count >= _MOST:
            self.refuse(f"; reading stopped at row {error.row}, after {_MOST} faults")

    def errors(self) -> list[RunFileError]:
        """First fault of each column and kind; its message lists the rows of the others."""
        for first, others in self._groups.values():
            first.message += _same_in(others)
            others.clear()
        return [first for first, _ in self._groups.values()]

    def refuse(self, remark: str = "") -> None:
        """Raise the first fault, with the first ones of the other columns as `further`.

        Raises:
            RunFileError: There are faults.
        """
        errors = self.errors()
        if errors:
            errors[0].message += remark
        refuse_all(errors)


def _same_in(others: Sequence[_Place]) -> str:
    """Text that lists the rows of further faults; consecutive ones of the same value as a range."""
    by_range = itertools.groupby(enumerate(others), lambda one: (one[1][0] - one[0], one[1][1]))
    ranges = [[place for _, place in group] for _, group in by_range]
    listed = []
    for group in ranges[:_SHOWN]:
        (first, value), last = group[0], group[-1][0]
        rows = f"row {first}" if first == last else f"rows {first} to {last}"
        listed.append(rows + (f" ({quoted(value)})" if isinstance(value, str) and value else ""))
    unlisted = sum(map(len, ranges[_SHOWN:]))
    more = f" and {unlisted} more" if unlisted else ""
    return f"; the same in {', '.join(listed)}{more}" if listed else ""


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
