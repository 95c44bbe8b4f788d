"""Places that the user named for results, tried out before the work."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from identification.errors import OptionError

__all__ = ["writable_directory", "writable_file"]


@contextmanager
def writable_directory(directory: Path) -> Iterator[None]:
    """Make a directory and see that it can be written, before hours are spent on its content.

    Where the work fails and the directory was made here and is empty, it is removed again.

    Args:
        directory: The directory; those above it are made, too.

    Raises:
        OptionError: It cannot be made or written.
    """
    is_new = not directory.exists()
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise OptionError(
            f"--out {directory}: cannot be written ({error.strerror}); name another directory",
            value=str(directory),
        ) from error
    try:
        yield
    except BaseException:
        if is_new:
            with suppress(OSError):
                directory.rmdir()
        raise


@contextmanager
def writable_file(path: Path) -> Iterator[None]:
    """See that a file can be written, as `writable_directory` does for a directory.

    Args:
        path: The file; the directories above it are made.

    Raises:
        OptionError: It is a directory, or cannot be written.
    """
    if path.is_dir():
        raise OptionError(f"--out {path}: is a directory; name a file", value=str(path))
    with writable_directory(Path(os.path.abspath(path)).parent):
        yield
