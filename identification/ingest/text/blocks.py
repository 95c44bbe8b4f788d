"""Streaming line reader: a text file as blocks of whole lines, in bounded memory.

Memory use is limited to about two chunks of 8 MiB and one partial line.  Number and length of the
lines are checked while reading, so that a file of zeros or a line of a gigabyte is rejected early.
Line ends become line feeds and UTF-16 becomes UTF-8; other encodings pass unchanged.  Marks of a
device in the lines are rewritten before the table is detected:

10:15:32.100 -> 12.5,0.31           a serial monitor writes the time of arrival in front of
[2026-03-01 10:15:32.100] 12.5,0.31 each line; it becomes the first cell
1,+   12.50,-    0.310              a sign apart from its number, as Graphtec writes it
"""

from __future__ import annotations

import codecs
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

from identification.errors import EmptyFile, FileTooLarge, LineTooLong, NotText, RunFileError
from identification.ingest.file import Limits

__all__ = ["Block", "Splitter", "plain_lines", "utf_16_of"]

_TIME = rb"(?:\d{4}-\d\d-\d\d[ T])?\d\d:\d\d:\d\d\.\d{3,6}"
_STAMP = re.compile(rb"^(?:\[(?P<a>%b)\]|(?P<b>%b) -?>) ?" % (_TIME, _TIME), re.M)
_SIGN = re.compile(rb"(^|[,;\t])([+-]) +(?=[\d.])", re.M)


@dataclass(frozen=True)
class Block:
    """Consecutive whole lines of a file."""

    text: bytes
    """Bytes of the lines, with line feeds as line ends."""
    first_line: int
    """Line number, counted from 1, of the first line in `text`."""
    terminated: bool = True
    """False for the last block of a file whose last line has no line end."""

    @property
    def lines(self) -> list[str]:
        """The lines as text; bytes that are no UTF-8 are those of Windows, in header texts."""
        try:
            return self.text.decode("utf-8").split("\n")
        except UnicodeDecodeError:
            return self.text.decode("cp1252", "replace").split("\n")

    @property
    def head(self) -> list[str]:
        """The lines within the first 64 KiB, the last one perhaps in part."""
        return replace(self, text=self.text[:_HEAD_BYTES]).lines

    def from_line(self, line: int) -> Block:
        """Remainder of the block, beginning at a line number of the file."""
        at = 0
        for _ in range(line - self.first_line):
            at = self.text.find(b"\n", at) + 1
        return Block(self.text[at:], line, self.terminated)


# Signatures of binary formats that users submit in place of a text table.
_SIGNATURES = (
    (b"PK\x03\x04", "a zip archive in another archive"),
    (b'{"', "JSON"),
    (b"[{", "JSON"),
    (b"\x1f\x8b", "compressed twice"),
    (b"BZh91AY&SY", "compressed twice"),
    (b"\xfd7zXZ", "compressed twice"),
    (b"7z\xbc\xaf", "a 7-Zip archive (unpack it, and give the file with the samples)"),
    (b"Rar!", "a RAR archive (unpack it, and give the file with the samples)"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd (unpack it)"),
    (b"TDSh", "the index of a TDMS file, whose data are in the .tdms file beside it"),
    (b"SQLite format 3", "an SQLite database"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
    (b"\xff\xd8\xff", "a picture"),
    (b"\x93NUMPY", "a NumPy array"),
)
_CONTROL = bytes(code for code in range(1, 32) if code not in b"\t\n\v\f\r\x1a")
_HEAD_BYTES = 65_536
_EXPORT = "export it as a text table (CSV, UTF-8)"


class Splitter:
    """Splitter of chunks of any encoding and line end into blocks of whole lines."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._line = 1
        self._newline = b"\n"
        self._decoder: codecs.IncrementalDecoder | None = None

    def split(self, chunks: Iterator[bytes]) -> Iterator[Block]:
        """Split each chunk after its last line end; there is at least one block.

        Raises:
            EmptyFile: The file has no bytes.
            FileTooLarge: The file exceeds the limit of bytes or rows.
            LineTooLong: A line exceeds the limit.
            NotText: The content is binary, in UTF-32, or contains a NUL byte.
        """
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
        if not held and not carry:
            raise EmptyFile("the file is empty; expected a header and samples")
        # Keep an unterminated last line with the lines before it, which show how long it should be.
        yield self._block(held + carry, terminated=not carry)

    def _begin(self, chunk: bytes) -> bytes:
        """Detect the encoding and the line end from the first chunk."""
        for signature, what in _SIGNATURES:
            if chunk.startswith(signature):
                raise NotText(f"this is {what}, not a text table; {_EXPORT}")
        if chunk.startswith((b"\xff\xfe\x00\x00", b"\x00\x00\xfe\xff")):
            raise NotText(f"the text is in UTF-32; {_EXPORT}")
        if (codec := utf_16_of(chunk)) is not None:
            # Broken characters become replacement characters, so the error names their row.
            self._decoder = codecs.getincrementaldecoder(codec)("replace")
        elif _looks_binary(chunk[:_HEAD_BYTES]):
            raise NotText(f"the bytes are not text; {_EXPORT}")
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
        at = text.find(b"\0")
        if at >= 0:
            raise NotText(
                "contains a NUL byte, probably because the logger lost power; "
                "cut the file before this line",
                row=self._line + text.count(b"\n", 0, at),
            )
        for start in range(0, len(text) - self._limits.line_bytes, self._limits.line_bytes):
            # A range of this length without a line end lies within a line of at least this length.
            if text.find(b"\n", start, start + self._limits.line_bytes) < 0:
                raise self._too_long(self._line + text.count(b"\n", 0, start))
        self._line += text.count(b"\n")
        if self._line - 1 > self._limits.rows:
            raise FileTooLarge(
                f"more rows than the limit of {self._limits.rows}; "
                "split the file or record at a lower rate",
                row=self._limits.rows + 1,
            )
        return block

    def _too_long(self, line: int) -> RunFileError:
        return LineTooLong(
            f"a line of more than {self._limits.line_bytes} bytes; "
            "expected one sample per line with a few numbers",
            row=line,
        )


def plain_lines(blocks: Iterator[Block]) -> Iterator[Block]:
    """Rewrite the lines of all blocks if at least half of the first ones have a kind of mark."""
    first = next(blocks)
    lines = [line.encode() for line in first.head if line.strip()]
    stamped, signed = (
        2 * sum(map(bool, map(p.search, lines))) > len(lines) for p in (_STAMP, _SIGN)
    )
    bare = _STAMP.sub(b"", b"\n".join(lines))
    delimiter = next((sign for sign in (b"\t", b";", b",") if bare.count(sign) >= len(lines)), b" ")
    blocks = itertools.chain(iter([first]), blocks)
    del first
    for block in blocks:
        text = block.text
        if stamped:
            text = _STAMP.sub(lambda m: (m["a"] or m["b"]).replace(b" ", b"T") + delimiter, text)
        if signed:
            text = _SIGN.sub(rb"\1\2", text)
        yield replace(block, text=text)


def utf_16_of(content: bytes) -> str | None:
    """Codec of a text in UTF-16, from its first bytes; None for any other content.

    Without a byte order mark, nine of ten characters are those of ASCII, whose second byte is zero.
    """
    for codec, mark in (("utf-16-le", codecs.BOM_UTF16_LE), ("utf-16-be", codecs.BOM_UTF16_BE)):
        if content.startswith(mark):
            return codec
        high, low = (content[codec.endswith(end) : _HEAD_BYTES : 2] for end in ("le", "be"))
        if high.count(0) * 10 > len(low) * 9 and b"\n" in low and not _looks_binary(low):
            return codec
    return None


def _looks_binary(head: bytes) -> bool:
    """Return True if over 0.5 % of the bytes are control characters or over 25 % are NUL."""
    control = len(head) - len(head.translate(None, delete=_CONTROL))
    return control * 200 > len(head) or head.count(0) * 4 > len(head)
