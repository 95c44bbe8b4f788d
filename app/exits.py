"""How the command line ends: a status for each error, and one line that says what went wrong."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Iterator
from typing import Final

import typer

from app.space import is_full
from identification.errors import ComputationError, InputError

__all__ = ["EXIT_STATUS", "Stopped", "failed"]

EXIT_STATUS: Final[dict[type[BaseException], int]] = {
    typer.BadParameter.__mro__[2]: 2,  # all that click says about the words that were typed
    InputError: 2,
    ComputationError: 1,
    KeyboardInterrupt: 130,
    BaseException: 1,
}
"""Exit status of each error; of a class that is not listed, that of its nearest parent."""

_DEBUG: Final = "MOTORID_TRACEBACK"


class Stopped(Exception):
    """Carries what stopped a command past click."""

    def __init__(self, reason: BaseException) -> None:
        self.reason = reason
        super().__init__(str(reason))


def failed(error: BaseException) -> int:
    """Say on one line of standard error what went wrong.

    Args:
        error: What ended the program.

    Returns:
        The exit status of the error.
    """
    if os.environ.get(_DEBUG):
        traceback.print_exception(error)
    if isinstance(error, BrokenPipeError):
        # What is left in the buffer has no reader either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    full = next((cause for cause in _causes(error) if is_full(cause)), None)
    print(f"motorid: {_message(full or error)}", file=sys.stderr)  # noqa: T201
    if full is not None:
        # Neither the words that were typed nor a file are at fault, whatever could not be written.
        return EXIT_STATUS[BaseException]
    return next(EXIT_STATUS[kind] for kind in type(error).__mro__ if kind in EXIT_STATUS)


def _message(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt | typer.Abort):
        text = "interrupted"
    elif isinstance(error, BrokenPipeError):
        text = "the reader of the output went away"
    elif is_full(error):
        where = _file(error) if isinstance(error, OSError) else " of the database"
        text = f"no space is left on the device{where}; have some made, then try again"
    elif isinstance(error, OSError):
        text = f"{error.strerror or error}{_file(error)}"
    elif isinstance(error, MemoryError):
        text = "not enough memory; fit fewer or shorter runs"
    elif isinstance(error, InputError | ComputationError):
        text = str(error)
    else:
        format_message = getattr(error, "format_message", None)
        text = format_message() if format_message else _unforeseen(error)
    return " ".join(text.split())


def _causes(error: BaseException) -> Iterator[BaseException]:
    cause: BaseException | None = error
    while cause is not None:
        yield cause
        cause = cause.__cause__


def _file(error: OSError) -> str:
    return f": {error.filename}" if error.filename else ""


def _unforeseen(error: BaseException) -> str:
    # SQLAlchemy's own words hold the statement; those of the driver begin with what is wrong.
    original = getattr(error, "orig", None)
    reason = error if original is None else str(original).strip().partition("\n")[0]
    return (
        f"internal error, {type(error).__name__}: {reason} (set {_DEBUG}=1 to see where, and "
        "please report it)"
    )
