"""Open run file: limits, first bytes, content in chunks and SHA-256 of every byte."""

from __future__ import annotations

import bz2
import gzip
import hashlib
import io
import lzma
import os
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from identification.errors import DamagedFile, FileTooLarge, RunFileError, UnreadableFile

__all__ = ["Limits", "RunFile", "naming", "open_run_file", "unpacked"]

_CHUNK_BYTES = 8 << 20
_HEAD_BYTES = 1 << 16
_Packed = gzip.GzipFile | bz2.BZ2File | lzma.LZMAFile | zipfile.ZipExtFile
_COMPRESSIONS: tuple[tuple[bytes, str, Callable[[BinaryIO], _Packed]], ...] = (
    (b"\x1f\x8b", ".gz", lambda stream: gzip.GzipFile(fileobj=stream)),
    (b"BZh91AY&SY", ".bz2", bz2.BZ2File),
    (b"\xfd7zXZ\x00", ".xz", lzma.LZMAFile),
)
"""First bytes, ending and decompressor."""


@dataclass(frozen=True)
class Limits:
    """Size limits of a run file; a larger file is rejected."""

    bytes: int = 2_000_000_000
    """Size of the file [bytes]."""
    rows: int = 50_000_000
    """Number of lines of a text file, else of samples."""
    columns: int = 1_000
    line_bytes: int = 1_000_000
    """Length of one line [bytes]; a line of twice this length is always rejected."""


class RunFile:
    """Run file that is open for reading; `name` is that in messages.

    Attributes:
        head: First bytes of the file, at most 64 KiB, by which a reader recognises its format.

    Raises:
        FileTooLarge: The file exceeds the limit of bytes; also raised while it is read.
    """

    def __init__(self, stream: BinaryIO | _Packed, name: str, limits: Limits) -> None:
        self.name = name
        self.limits = limits
        self._stream = stream
        self._digest = hashlib.sha256()
        self._total = 0
        self._ended = False
        self._pending = self._read()
        self.head = self._pending[:_HEAD_BYTES]

    def chunks(self) -> Iterator[bytes]:
        """Iterate over the content that has not been read yet, in bounded memory."""
        return iter(self._next, b"")

    def content(self) -> bytes:
        """Read the content that has not been read yet."""
        return b"".join(self.chunks())

    def seekable(self) -> BinaryIO:
        """Whole content for random access, valid while the file is open.

        The file is hashed first; compressed content is unpacked into memory, within the limit.
        """
        if isinstance(self._stream, _Packed):
            return io.BytesIO(self.content())
        self.sha256()
        self._stream.seek(0)
        return self._stream

    def sha256(self) -> str:
        """SHA-256 of the whole file in hexadecimal, whatever part of it a reader has read."""
        while not self._ended:
            self._next()
        return self._digest.hexdigest()

    def _next(self) -> bytes:
        chunk, self._pending = self._pending, b""
        return chunk or self._read()

    def _read(self) -> bytes:
        """Read, hash and count one chunk; a file may grow while it is read."""
        size = self._total
        if not isinstance(self._stream, _Packed):
            size = max(os.fstat(self._stream.fileno()).st_size, size)
        if size > self.limits.bytes:
            raise FileTooLarge(
                f"{size} bytes are more than the limit of {self.limits.bytes}; "
                "split the file or record at a lower rate",
                value=size,
            )
        with _as_damaged() if isinstance(self._stream, _Packed) else _as_unreadable():
            chunk = self._stream.read(_CHUNK_BYTES)
        self._total += len(chunk)
        self._ended = not chunk
        self._digest.update(chunk)
        return chunk


def unpacked(file: RunFile) -> RunFile:
    """The content of a file compressed with gzip, bzip2 or xz; any other file itself.

    The name loses its ending.  The limits apply to the content, which is unpacked as it is read.
    """
    for signature, ending, opened in _COMPRESSIONS:
        if file.head.startswith(signature):
            name = file.name[: -len(ending)] if file.name.lower().endswith(ending) else file.name
            return RunFile(opened(file.seekable()), name, file.limits)
    return file


@contextmanager
def open_run_file(path: Path, name: str, limits: Limits) -> Iterator[RunFile]:
    """Open a regular file.

    Raises:
        UnreadableFile: The file is missing, not a regular file, or not readable.
        FileTooLarge: The file exceeds the limit of bytes.
    """
    with _as_unreadable():
        # Check before opening: opening a pipe without a writer blocks.
        if not path.is_dir():
            _refuse_special(path.stat())
        stream = path.open("rb")
    with stream:
        _refuse_special(os.fstat(stream.fileno()))
        yield RunFile(stream, name, limits)


@contextmanager
def naming(file: str | None) -> Iterator[None]:
    """Add the name of a file to errors that are raised without one.

    Raises:
        RunFileError: The error raised within, with the name.
    """
    try:
        yield
    except RunFileError as error:
        error.file = file if error.file is None else error.file
        raise


@contextmanager
def _as_damaged() -> Iterator[None]:
    """Turn an error of a decompressor into an error with its reason."""
    try:
        yield
    except (OSError, EOFError, lzma.LZMAError, zipfile.BadZipFile, zlib.error) as error:
        raise DamagedFile(
            f"the compression is damaged ({error}); copy or compress the file again"
        ) from error


@contextmanager
def _as_unreadable() -> Iterator[None]:
    """Turn an error of the operating system into an error with its reason."""
    try:
        yield
    except (OSError, ValueError) as error:
        # ValueError: the path itself holds a NUL.
        reason = getattr(error, "strerror", None) or "the path is not valid"
        raise UnreadableFile(
            f"cannot be opened ({reason}); check the path and the permissions"
        ) from error


def _refuse_special(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise UnreadableFile("is not a regular file; give the path of a file")
