"""Streaming line reader: a file as blocks of whole text lines, in bounded memory.

Memory use is limited to about two chunks of 8 MiB and one partial line.  File size, number of lines
and line length are checked while reading, so that a file of zeros or a line of a gigabyte is
rejected early.  Line ends become line feeds and UTF-16 becomes UTF-8; other encodings pass
unchanged.

    digest = hashlib.sha256()
    for block in read_blocks(Path("run1.csv"), "run1.csv", Limits(), digest):
        block.text, block.first_line
"""

from __future__ import annotations

import codecs
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Protocol

from identification.errors import (
    EmptyFile,
    FileTooLarge,
    LineTooLong,
    NotText,
    RunFileError,
    UnreadableFile,
)

__all__ = ["Block", "Limits", "read_blocks"]

_CHUNK_BYTES = 8 << 20


@dataclass(frozen=True)
class Limits:
    """Size limits of a run file; a larger file is rejected.

    Args:
        bytes: Size of the file [bytes].
        rows: Number of lines of the file.
        columns: Number of columns of the table.
        line_bytes: Length of one line [bytes]; a line of twice this length is always rejected.
    """

    bytes: int = 2_000_000_000
    rows: int = 50_000_000
    columns: int = 1_000
    line_bytes: int = 1_000_000


@dataclass(frozen=True)
class Block:
    """Consecutive whole lines of a file.

    Args:
        text: Bytes of the lines, with line feeds as line ends.
        first_line: Line number, counted from 1, of the first line in `text`.
        terminated: False for the last block of a file whose last line has no line end.
    """

    text: bytes
    first_line: int
    terminated: bool = True

    def from_line(self, line: int) -> Block:
        """Remainder of the block, beginning at a line number of the file."""
        at = 0
        for _ in range(line - self.first_line):
            at = self.text.find(b"\n", at) + 1
        return Block(self.text[at:], line, self.terminated)


class Digest(Protocol):
    """Interface of a hash object of the standard library."""

    def update(self, data: bytes, /) -> None:
        """Add bytes to the hash."""


# Signatures of binary formats that users submit in place of a text table.
_SIGNATURES = (
    (b"PK\x03\x04", "a zip archive or an Excel workbook"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
    (b"\x1f\x8b", "gzip-compressed"),
    (b"BZh", "bzip2-compressed"),
    (b"\xfd7zXZ", "xz-compressed"),
    (b"7z\xbc\xaf", "a 7-Zip archive"),
    (b"\x28\xb5\x2f\xfd", "zstd-compressed"),
    (b"\x89HDF", "HDF5 or MATLAB 7.3"),
    (b"MATLAB 5.0 MAT", "a MATLAB file"),
    (b"MDF     ", "an MDF measurement file"),
    (b"TDSm", "a TDMS measurement file"),
    (b"PAR1", "Parquet"),
    (b"ARROW1", "Arrow"),
    (b"SQLite format 3", "an SQLite database"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
    (b"\xff\xd8\xff", "a picture"),
    (b"\x93NUMPY", "a NumPy array"),
)
_CONTROL = bytes(code for code in range(1, 32) if code not in b"\t\n\v\f\r\x1a")
_EXPORT = "export it as a text table (CSV, UTF-8)"


def read_blocks(path: Path, name: str, limits: Limits, digest: Digest) -> Iterator[Block]:
    """Read a file as blocks of whole lines.

    Args:
        path: File to read; it must be a regular file.
        name: Name of the file in messages.
        limits: Size limits.
        digest: Hash that receives every byte read, in order.

    Yields:
        Blocks in file order, at least one.

    Raises:
        UnreadableFile: The file is missing, not a regular file, or not readable.
        EmptyFile: The file has no bytes.
        FileTooLarge: The file exceeds the limit of bytes or rows.
        LineTooLong: A line exceeds the limit.
        NotText: The content is binary, in UTF-32, or contains a NUL byte.
    """
    try:
        # Check before opening: opening a pipe without a writer blocks.
        if not stat.S_ISREG(path.stat().st_mode) and not path.is_dir():
            raise UnreadableFile("is not a regular file; give the path of a file", file=name)
        with path.open("rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise UnreadableFile("is not a regular file; give the path of a file", file=name)
            empty = True
            for block in _Splitter(name, limits).split(_chunks(file, name, limits, digest)):
                empty = False
                yield block
    except (OSError, ValueError) as error:
        # ValueError: the path itself holds a NUL.
        reason = getattr(error, "strerror", None) or "the path is not valid"
        raise UnreadableFile(
            f"cannot be opened ({reason}); check the path and the permissions", file=name
        ) from error
    if empty:
        raise EmptyFile("the file is empty; expected a header and samples", file=name)


def _chunks(file: BinaryIO, name: str, limits: Limits, digest: Digest) -> Iterator[bytes]:
    """Read and hash chunks; count the bytes, because a file may grow while it is read."""
    size = os.fstat(file.fileno()).st_size
    total = 0
    while True:
        if max(size, total) > limits.bytes:
            raise FileTooLarge(
                f"{max(size, total)} bytes are more than the limit of {limits.bytes}; "
                "split the file or record at a lower rate",
                file=name,
                value=max(size, total),
            )
        chunk = file.read(_CHUNK_BYTES)
        if not chunk:
            return
        total += len(chunk)
        digest.update(chunk)
        yield chunk


class _Splitter:
    """Splitter of chunks of any encoding and line end into blocks of whole lines."""

    def __init__(self, name: str, limits: Limits) -> None:
        self._name = name
        self._limits = limits
        self._line = 1
        self._newline = b"\n"
        self._decoder: codecs.IncrementalDecoder | None = None

    def split(self, chunks: Iterator[bytes]) -> Iterator[Block]:
        """Split each chunk after its last line end."""
        held = carry = b""
        first = True
        for raw in chunks:
            chunk = self._begin(raw) if first else self._to_utf8(raw)
            first = False
            text = carry + chunk
            cut = text.rfind(self._newline) + 1
            carry = text[cut:]
            if len(carry) > self._limits.line_bytes:
                raise self._too_long(self._line + (held + text[:cut]).count(self._newline))
            if cut and held:
                yield self._block(held, terminated=True)
            held = text[:cut] or held
        if self._decoder is not None:
            carry += self._decoder.decode(b"", True).encode()
        # Keep an unterminated last line with the lines before it, which show how long it should be.
        if held or carry:
            yield self._block(held + carry, terminated=not carry)

    def _begin(self, chunk: bytes) -> bytes:
        """Detect the encoding and the line end from the first chunk."""
        for signature, what in _SIGNATURES:
            if chunk.startswith(signature):
                raise NotText(f"this is {what}, not a text table; {_EXPORT}", file=self._name)
        if chunk.startswith((b"\xff\xfe\x00\x00", b"\x00\x00\xfe\xff")):
            raise NotText(f"the text is in UTF-32; {_EXPORT}", file=self._name)
        if chunk.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            little = chunk.startswith(codecs.BOM_UTF16_LE)
            codec = "utf-16-le" if little else "utf-16-be"
            # Broken characters become replacement characters, so the error names their row.
            self._decoder = codecs.getincrementaldecoder(codec)("replace")
        elif _looks_binary(chunk[:65536]):
            raise NotText(f"the bytes are not text; {_EXPORT}", file=self._name)
        text = self._to_utf8(chunk).removeprefix(codecs.BOM_UTF8)
        if b"\n" not in text and b"\r" in text:
            self._newline = b"\r"
        return text

    def _to_utf8(self, chunk: bytes) -> bytes:
        return chunk if self._decoder is None else self._decoder.decode(chunk).encode()

    def _block(self, text: bytes, *, terminated: bool) -> Block:
        if b"\r" in text:
            text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        block = Block(text, self._line, terminated)
        self._refuse_nul(block)
        for start in range(0, len(text) - self._limits.line_bytes, self._limits.line_bytes):
            # A range of this length without a line end lies within a line of at least this length.
            if text.find(b"\n", start, start + self._limits.line_bytes) < 0:
                raise self._too_long(self._line + text.count(b"\n", 0, start))
        self._line += text.count(b"\n")
        if self._line - 1 > self._limits.rows:
            raise FileTooLarge(
                f"more rows than the limit of {self._limits.rows}; "
                "split the file or record at a lower rate",
                file=self._name,
                row=self._limits.rows + 1,
            )
        return block

    def _too_long(self, line: int) -> RunFileError:
        return LineTooLong(
            f"a line of more than {self._limits.line_bytes} bytes; "
            "expected one sample per line with a few numbers",
            file=self._name,
            row=line,
        )

    def _refuse_nul(self, block: Block) -> None:
        at = block.text.find(b"\0")
        if at >= 0:
            raise NotText(
                "contains a NUL byte, probably because the logger lost power; "
                "cut the file before this line",
                file=self._name,
                row=block.first_line + block.text.count(b"\n", 0, at),
            )


def _looks_binary(head: bytes) -> bool:
    """Return True if over 0.5 % of the bytes are control characters or over 25 % are NUL."""
    control = len(head) - len(head.translate(None, delete=_CONTROL))
    return control * 200 > len(head) or head.count(0) * 4 > len(head)
