"""Exit statuses and one-line error messages of the command line."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, Final, TextIO

import typer
import typer.core

from app.commands.arguments import map_arguments
from app.disk import is_full
from identification.errors import ComputationError, InputError

__all__ = [
    "EXIT_STATUS",
    "TRACEBACK",
    "CommandGroup",
    "HungUp",
    "CaughtSignals",
    "Stopped",
    "Terminated",
    "failed",
    "prepare_streams",
    "raise_missed",
    "raised_signals",
]


class Terminated(BaseException):
    """SIGTERM received; like `KeyboardInterrupt`, not caught by handlers of `Exception`."""


class HungUp(Terminated):
    """SIGHUP received: the terminal was closed."""


EXIT_STATUS: Final[dict[type[BaseException], int]] = {
    typer.BadParameter.__mro__[2]: 2,  # click's base class of usage errors
    InputError: 2,
    ComputationError: 1,
    KeyboardInterrupt: 130,
    Terminated: 143,
    HungUp: 129,
    BaseException: 1,
}
"""Exit status of each error class; an unlisted class has the status of its nearest base class."""

_SIGNALS: Final = {
    signal.SIGINT: KeyboardInterrupt,
    signal.SIGTERM: Terminated,
    signal.SIGHUP: HungUp,
}
_DEFAULTS: Final = (signal.SIG_DFL, signal.default_int_handler)
TRACEBACK: Final = "MOTORID_TRACEBACK"
"""Environment variable that enables tracebacks of errors."""


class Stopped(Exception):
    """Wrapper that carries an interruption unchanged through click."""

    def __init__(self, reason: BaseException) -> None:
        self.reason = reason
        super().__init__(str(reason))


class CaughtSignals:
    """Signals received while a command ran; `raised` is the exception of the first one."""

    def __init__(self) -> None:
        self.raised: BaseException | None = None

    def end(self, number: int, frame: FrameType | None) -> None:
        """Raise the exception of a signal and keep it, because a library may convert it."""
        self.raised = self.raised or _SIGNALS[signal.Signals(number)]()
        raise self.raised


_listening: list[CaughtSignals] = []


def raise_missed() -> None:
    """Raise the exception of a received signal again.

    Python ignores an exception in a finalizer or a callback, and a signal may come during one.
    """
    for came in _listening:
        if came.raised is not None:
            raise came.raised


class CommandGroup(typer.core.TyperGroup):
    """Command group that leaves interruptions to `main`."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command; click would map Ctrl-C and a closed pipe to its own exit statuses."""
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, BrokenPipeError) as error:
            raise Stopped(error) from error


@contextmanager
def raised_signals() -> Iterator[CaughtSignals]:
    """Convert SIGINT, SIGTERM and SIGHUP into exceptions while the block runs.

    Signals that are ignored (nohup) or already have a handler are left unchanged.
    """
    came = CaughtSignals()
    is_main = threading.current_thread() is threading.main_thread()
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    ours = [n for n, handler in before.items() if is_main and handler in _DEFAULTS]
    for number in ours:
        signal.signal(number, came.end)
    report = sys.unraisablehook

    def unraisable(ignored: sys.UnraisableHookArgs) -> None:
        """Report an exception that Python ignores, unless `raise_missed` raises it again."""
        if came.raised is None or ignored.exc_value is not came.raised:
            report(ignored)

    sys.unraisablehook = unraisable
    _listening.append(came)
    try:
        yield came
    finally:
        _listening.remove(came)
        sys.unraisablehook = report
        # A second signal during the cleanup ends the process at once.
        for number in ours:
            signal.signal(number, before[number])


def prepare_streams() -> None:
    """Make standard output and standard error writable in any environment.

    If the shell closed a stream, its descriptor would be reused by the next file opened.
    """
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        # Characters outside the stream's encoding become question marks and raise no error.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def failed(error: BaseException) -> int:
    """Print a one-line error message on standard error and return the exit status."""
    if os.environ.get(TRACEBACK):
        traceback.print_exception(error)
    if isinstance(error, BrokenPipeError):
        _drop(sys.stdout)
    full = next((cause for cause in _causes(error) if is_full(cause)), None)
    try:
        print(f"motorid: {_message(full or error)}", file=sys.stderr, flush=True)  # noqa: T201
    except OSError:
        # Standard error has no reader either: only the status is left.
        _drop(sys.stderr)
    if full is not None:
        # A full disk is not an input error, whichever write failed.
        return EXIT_STATUS[BaseException]
    return next(EXIT_STATUS[kind] for kind in type(error).__mro__ if kind in EXIT_STATUS)


def _drop(stream: TextIO) -> None:
    """Redirect a stream to the null device; its buffered output has no reader."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _message(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt | typer.Abort):
        text = "interrupted"
    elif isinstance(error, Terminated):
        signal_name = "SIGHUP" if isinstance(error, HungUp) else "SIGTERM"
        text = f"terminated by {signal_name}"
    elif isinstance(error, BrokenPipeError):
        text = "the reader closed the output pipe"
    elif is_full(error):
        where = _file(error) if isinstance(error, OSError) else " of the database"
        text = f"no space is left on the device{where}; free some space, then repeat the command"
    elif isinstance(error, OSError):
        text = f"{error.strerror or error}{_file(error)}"
    elif isinstance(error, MemoryError):
        text = "not enough memory; fit fewer or shorter runs"
    elif isinstance(error, InputError):
        text = error.described(map_arguments)
    elif isinstance(error, ComputationError):
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
    # SQLAlchemy's message contains the statement; the driver's first line names the fault.
    original = getattr(error, "orig", None)
    reason = error if original is None else str(original).strip().partition("\n")[0]
    return (
        f"internal error, {type(error).__name__}: {reason} (please report it, with "
        f"the traceback that {TRACEBACK}=1 prints)"
    )
