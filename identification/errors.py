"""Exception tree of the package.

    IdentificationError
    ├── InputError                 the caller's data or options are at fault; exit status 2
    │   ├── RunFileError           a run file cannot be read as a run; a leaf for each reason
    │   ├── ContradictoryRuns      runs contradict physics or each other
    │   └── OptionError            an option has a value that is not accepted
    └── ComputationError           the input was valid, but the calculation failed; exit status 1

Catch a leaf to recover, a node to report.  Every message states on one line what was wrong, with
the value, what was expected and what to do next.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

__all__ = [
    "AbsurdValue",
    "AmbiguousAngle",
    "AmbiguousColumn",
    "AmbiguousTable",
    "AmbiguousUnit",
    "BackwardTime",
    "ComputationError",
    "ContradictoryRuns",
    "DamagedFile",
    "DuplicateColumn",
    "EmptyFile",
    "Example",
    "FileTooLarge",
    "HeaderTooLong",
    "IdentificationError",
    "InputError",
    "LineTooLong",
    "MappingError",
    "MissingColumn",
    "MissingLibrary",
    "MissingValue",
    "NoHeader",
    "NoRows",
    "NoTable",
    "NotANumber",
    "NotFinite",
    "NotText",
    "OptionError",
    "OutOfMemory",
    "RaggedRow",
    "RepeatedTime",
    "RunFileError",
    "TooFewRows",
    "UnclosedQuote",
    "UnknownUnit",
    "UnreadableFile",
    "UnsupportedContent",
    "WrongUnit",
    "of_file",
]


Example = Mapping[str, object]
"""Mapping of columns to channels: ``{"speed_rad_s": {"column": "n", "unit": "rpm"}}``."""


def of_file(file: str, example: Example) -> Example:
    """The mapping restricted to one file, as a fault in its cells may not be one of other files."""
    return {"files": {file: example}}


def _as_json(examples: Sequence[Example]) -> str:
    """Text of alternative mappings as JSON."""
    shown = (json.dumps(example, ensure_ascii=False) for example in examples)
    return f"a mapping such as {' or '.join(shown)}"


class IdentificationError(Exception):
    """Base class of all errors that this package raises deliberately."""


class InputError(IdentificationError):
    """Data or options of the caller are at fault.

    Args:
        message: What was wrong, what was expected, what to do next.
        file: Name of the file at fault, as the caller named it.
        row: Line of that file, counted from 1 with the header line.
        column: Name of the column as in the file.
        value: The offending text or number.
        further: Other errors of the same file, so that one reading shows all of them.
        examples: Mappings, each a remedy; capitals stand for values that only the user knows.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        row: int | None = None,
        column: str | None = None,
        value: object = None,
        further: Sequence[InputError] = (),
        examples: Sequence[Example] = (),
    ) -> None:
        self.message = message
        self.file = file
        self.row = row
        self.column = column
        self.value = value
        self.further = tuple(further)
        self.examples = tuple(examples)
        super().__init__(str(self))

    def __str__(self) -> str:
        """Location and message on one line: ``run3.csv, row 412, column current_A: ...``."""
        return self.described(_as_json)

    def described(self, remedies: Callable[[Sequence[Example]], str]) -> str:
        """Text on one line, in which `remedies` words the examples for the user's interface."""
        named = ((self.file or None, ""), (self.row, "row "), (self.column, "column "))
        place = [f"{word}{value}" for value, word in named if value is not None]
        text = f"{', '.join(place)}: {self.message}" if place else self.message
        text += f", or give {remedies(self.examples)}" if self.examples else ""
        for number, other in enumerate(self.further, 2):
            text += f"; ({number}) {other.described(remedies)}"
        return text


class ContradictoryRuns(InputError):
    """Runs contradict physics or each other.

    Args:
        message: All findings and the possible remedies.
        findings: Each finding as plain data.
    """

    code: ClassVar[str] = "contradictory_runs"

    def __init__(self, message: str, findings: Sequence[Mapping[str, object]] = ()) -> None:
        self.findings = [dict(finding) for finding in findings]
        super().__init__(message)


class RunFileError(InputError):
    """A run file cannot be read as a run of a motor.

    `code` is a stable identifier for scripts, such as ``missing_column``; every leaf has its own.
    """

    code: ClassVar[str] = "run_file"

    def __init_subclass__(cls, code: str = "") -> None:
        cls.code = code or cls.code


class UnreadableFile(RunFileError, code="unreadable_file"):
    """The file does not exist, is not a regular file, or may not be read."""


class FileTooLarge(RunFileError, code="file_too_large"):
    """The file has more bytes, rows or columns than the limits allow."""


class OutOfMemory(RunFileError, code="reader_memory"):
    """Decoding the content needs more memory than there is, as damaged sizes often do."""


class LineTooLong(RunFileError, code="line_too_long"):
    """One line is longer than the limit: the file is not a table of samples."""


class HeaderTooLong(RunFileError, code="header_too_long"):
    """One header cell is longer than the limit: it is not a column name."""


class NotText(RunFileError, code="not_text"):
    """The bytes are of no known format, or text with NUL bytes or in an unknown encoding."""


class DamagedFile(RunFileError, code="damaged_file"):
    """The file has the signature of a known format and cannot be decoded."""


class UnsupportedContent(RunFileError, code="unsupported_content"):
    """The file has a known format and content that is not read, such as external links."""


class MissingLibrary(RunFileError, code="missing_library"):
    """The library that reads the format is not installed."""


class AmbiguousTable(RunFileError, code="ambiguous_table"):
    """Several tables of the file contain a run, and none was chosen."""


class EmptyFile(RunFileError, code="empty_file"):
    """The file has no content."""


class NoTable(RunFileError, code="no_table"):
    """No line of numbers in at least two columns was found."""


class NoHeader(RunFileError, code="no_header"):
    """There is no line of column names above the numbers, and no mapping by number."""


class NoRows(RunFileError, code="no_rows"):
    """There are column names but no samples below them."""


class TooFewRows(RunFileError, code="too_few_rows"):
    """There are fewer samples than an identification can use."""


class RaggedRow(RunFileError, code="ragged_row"):
    """A line has a different number of fields than the table."""


class UnclosedQuote(RunFileError, code="unclosed_quote"):
    """A quotation mark is not closed on its line."""


class MissingColumn(RunFileError, code="missing_column"):
    """A required channel has no column."""


class AmbiguousColumn(RunFileError, code="ambiguous_column"):
    """Several columns could be the same channel."""


class DuplicateColumn(RunFileError, code="duplicate_column"):
    """Two columns have the same name."""


class UnknownUnit(RunFileError, code="unknown_unit"):
    """A unit is not in the table of accepted units."""


class WrongUnit(RunFileError, code="wrong_unit"):
    """The unit belongs to another quantity."""


class AmbiguousUnit(RunFileError, code="ambiguous_unit"):
    """The column has no unit, or two units that disagree."""


class MappingError(RunFileError, code="bad_mapping"):
    """The mapping given with the file is invalid."""


class NotANumber(RunFileError, code="not_a_number"):
    """A cell is not a number."""


class NotFinite(RunFileError, code="not_finite"):
    """A cell holds NaN, an infinity or a number that overflows."""


class MissingValue(RunFileError, code="missing_value"):
    """A cell is blank."""


class RepeatedTime(RunFileError, code="repeated_time"):
    """Two samples have the same time."""


class BackwardTime(RunFileError, code="backward_time"):
    """A sample is earlier than the one above it."""


class AbsurdValue(RunFileError, code="absurd_value"):
    """A value is one that no brushed motor can have."""


class AmbiguousAngle(RunFileError, code="ambiguous_angle"):
    """An angle jumps by an unknown period, or a channel with one changes too far in a sample."""


class OptionError(InputError):
    """An option has a value that is not accepted."""


class ComputationError(IdentificationError):
    """The input was valid, but the calculation failed."""
