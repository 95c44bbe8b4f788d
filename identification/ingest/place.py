"""Source location (file, row, column) of a channel sample, for errors and warnings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from identification.errors import RunFileError
from identification.ingest.run import RunWarning

__all__ = ["Places"]

Error = TypeVar("Error", bound=RunFileError)


@dataclass(frozen=True)
class Places:
    """Locator of a cell: file, row and column of a channel and a sample index.

    Args:
        file: Name of the file in messages.
        columns: Channel name to header text.
        line: Function from sample index to line number in the file.
    """

    file: str
    columns: Mapping[str, str]
    line: Callable[[int], int]

    def error(
        self, kind: type[Error], message: str, channel: str, sample: int, value: object
    ) -> Error:
        """Make an error of class `kind` located at one cell."""
        return kind(
            message,
            file=self.file,
            row=self.line(sample),
            column=self.columns.get(channel, channel),
            value=value,
        )

    def warning(
        self, code: str, message: str, channel: str | None = None, sample: int | None = None
    ) -> RunWarning:
        """Make a warning located at a file, a column or one cell."""
        return RunWarning(
            code=code,
            message=message,
            file=self.file,
            row=None if sample is None else self.line(sample),
            column=None if channel is None else self.columns.get(channel, channel),
        )
