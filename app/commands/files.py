"""Files of the commands: checks of output paths, results and posterior draws of earlier fits."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from identification.arrays import Array
from identification.errors import OptionError

__all__ = ["draws_of", "read_result", "writable_directory", "writable_file", "write_json"]

_RESULT_FILES = ("result.json", "posterior.nc", "report.html")


@contextmanager
def writable_directory(directory: Path, option: str = "--out") -> Iterator[None]:
    """Create a directory with its parents and check that it is writable, before the computation.

    If the block fails, a directory created here is removed again if it is empty.

    Raises:
        OptionError: The directory cannot be created or written.
    """
    is_new = not directory.exists()
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise OptionError(
            f"{option} {directory}: cannot be written ({error.strerror}); choose another directory"
        ) from error
    try:
        yield
    except BaseException:
        if is_new:
            with suppress(OSError):
                directory.rmdir()
        raise


@contextmanager
def writable_file(path: Path, option: str = "--out", inputs: Iterable[Path] = ()) -> Iterator[None]:
    """Check that a file can be written and is no input, as `writable_directory` does.

    Inputs are files or directories that the command reads, also by another name or link.

    Raises:
        OptionError: The path is a directory, cannot be written, or is an input.
    """
    for read in inputs:
        files = [read / name for name in _RESULT_FILES] if read.is_dir() else [read]
        if any(path.exists() and file.exists() and path.samefile(file) for file in files):
            raise OptionError(
                f"{option} {path}: is an input of this command; expected another file name"
            )
    if path.is_dir():
        raise OptionError(f"{option} {path}: is a directory; expected a file name")
    with writable_directory(Path(os.path.abspath(path)).parent, option):
        yield


def write_json(path: Path | None, content: object, result: Path | None) -> None:
    """Write a JSON file, if one is wanted; a file of the result that was read is no target."""
    if path is None:
        return
    from identification.result.atomic import write_text

    with writable_file(path, inputs=() if result is None else (result, result.parent)):
        write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def read_result(path: Path) -> dict[str, Any]:
    """Content of the result.json of ``motorid fit``."""
    from identification.identified import read_result as stored

    return stored(path).result


def draws_of(result: dict[str, Any], path: Path, most: int) -> tuple[dict[str, Array], str]:
    """Draws of the parameters (n_draw,), as estimated with the final model.

    A longer chain is thinned evenly.  The remark for the user is empty unless the draws are
    approximate.
    """
    from identification.identified import StoredResult

    stored = StoredResult(result, path)
    remark = (
        f"no posterior.nc in the directory of {path.name}: normal draws from its medians, "
        "standard deviations and correlations are used, so the intervals are approximate"
    )
    return stored.draws(most), "" if stored.has_posterior else remark
