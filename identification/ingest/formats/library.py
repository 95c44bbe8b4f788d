"""Calls of format libraries: import on demand, and errors of damaged files as messages."""

from __future__ import annotations

import gc
import importlib
import logging
import re
import struct
import sys
import traceback
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from identification.errors import DamagedFile, MissingLibrary, OutOfMemory
from identification.ingest.display import plain

__all__ = ["decoding", "imported"]

# A library that meets damaged bytes raises whatever the first wrong number leads to.
_FAULTS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    re.error,
    struct.error,
    zlib.error,
)

_FOLDERS = re.compile(r"(?<![^\s'\"(])(?:[A-Za-z]:)?[/\\](?:[^/\\'\"]+[/\\])+")
"""Folders of an absolute path, which a library puts into its errors: those of the service are not
for those who upload."""


def imported(module: str, what: str) -> ModuleType:
    """Import the library of a format; `what` names the file in the message, ``a Parquet file``.

    Raises:
        MissingLibrary: The library is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(module)
    except ImportError as error:
        raise MissingLibrary(
            f"this is {what}, and its library is not installed ({error.name or module}); install "
            "it with pip install 'motorid[formats]', or export a text table (CSV, UTF-8)",
            value=module,
        ) from error


@contextmanager
def decoding(what: str, faults: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Turn the faults of a library on damaged bytes into an error; silence its warnings.

    `faults` are exceptions of the library that no standard class covers.

    Raises:
        DamagedFile: The library could not decode the file.
        OutOfMemory: The file declares more content than fits into the memory.
    """
    disabled = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except MemoryError as error:
        _destroy(error)
        raise OutOfMemory(
            f"this looks like {what}, and decoding it needs more memory than there is, as the "
            "sizes in a damaged file often do; copy or export the file again, with the channels of "
            "the run alone"
        ) from error
    except _FAULTS + faults as error:
        _destroy(error)
        said = _FOLDERS.sub("", " ".join(str(error).split()))
        reason = plain(said or type(error).__name__, 120)
        raise DamagedFile(
            f"this looks like {what}, and its content cannot be decoded ({reason}); copy or export "
            "the file again"
        ) from error
    finally:
        logging.disable(disabled)


def _destroy(error: Exception) -> None:
    """Destroy the half-built objects of a library; an error in a destructor is not reported."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
    finally:
        sys.unraisablehook = hook
