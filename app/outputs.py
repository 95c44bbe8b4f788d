"""Check of output paths before the computation."""

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
    """Create a directory and check that it is writable, before hours of computation.

    If the block fails, a directory created here is removed again if it is empty.

    Args:
        directory: The directory; missing parents are created.

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
            f"--out {directory}: cannot be written ({error.strerror}); choose another directory",
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
    """Check that a file can be written, as `writable_directory` does for a directory.

    Args:
        path: The file; missing parent directories are created.

    Raises:
        OptionError: The path is a directory or cannot be written.
    """
    if path.is_dir():
        raise OptionError(f"--out {path}: is a directory; expected a file name", value=str(path))
    with writable_directory(Path(os.path.abspath(path)).parent):
        yield
