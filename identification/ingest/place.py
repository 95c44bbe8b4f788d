"""Where a channel stands in a file, for the errors and warnings of the checks."""

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
    """Translates channels and samples into file, row and column.

    Args:
        file: What messages call the file.
        columns: Channel name to header text.
        line: Gives the line of the file of a sample.
    """

    file: str
    columns: Mapping[str, str]
    line: Callable[[int], int]

    def error(
        self, kind: type[Error], message: str, channel: str, sample: int, value: object
    ) -> Error:
        """Make an error of a kind at one cell."""
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
        """Make a warning about a file, a column or one cell."""
        return RunWarning(
            code=code,
            message=message,
            file=self.file,
            row=None if sample is None else self.line(sample),
            column=None if channel is None else self.columns.get(channel, channel),
        )
