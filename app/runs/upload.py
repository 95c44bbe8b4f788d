"""An upload on its way to the disk: a multipart form, one part of which is the file.

    form = UploadForm(boundary, target, limit=512_000_000)
    form.feed(chunk)                 as chunks come
    upload = form.finish()           hash, size, the other fields

The parts are taken apart while they come in and the file goes straight to its place in the data
directory, hashed on the way, so that an upload of any size needs a few hundred kilobytes of memory.
Whatever a caller names the file is a label and never a path.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from app.errors import BadRequest, BodyTooLarge, FieldRefused, WrongMediaType
from app.storage import refused_when_full

if TYPE_CHECKING:
    from python_multipart.multipart import MultipartCallbacks

__all__ = ["FIELDS", "Upload", "UploadForm", "boundary_of", "label"]

FIELDS: Final = {"motor": 1_000, "mapping": 10_000}
"""Fields besides `file`, and how many bytes each may have.

A mapping has an entry for each of six channels; a fit takes 400 runs with one each.
"""

_LONGEST_LABEL = 200
_MOST_PARTS = 10


@dataclass(frozen=True)
class Upload:
    """A form that came in whole.

    Args:
        path: Where the bytes of the file are.
        name: Name of the file as the caller gave it, without directories.
        sha256: Hash of the bytes, in hexadecimal.
        size: Number of bytes.
        fields: The other fields of the form.
    """

    path: Path
    name: str
    sha256: str
    size: int
    fields: dict[str, str]


def boundary_of(content_type: str) -> bytes:
    """What separates the parts of a form.

    Raises:
        WrongMediaType: The body is no multipart form.
        BadRequest: The form does not say its boundary.
    """
    kind, options = parse_options_header(content_type)
    if kind != b"multipart/form-data":
        raise WrongMediaType("expected multipart/form-data with the run in the field `file`")
    boundary = options.get(b"boundary", b"")
    if not boundary:
        raise BadRequest("the Content-Type has no boundary; let the client make it")
    return boundary


def label(name: str) -> str:
    """The last part of a file name, printable and of bounded length."""
    last = name.replace("\\", "/").rstrip("/").rpartition("/")[2]
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in last).strip()
    return shown[-_LONGEST_LABEL:] or "run"


class UploadForm:
    """Takes a form apart while it comes in.

    A context: leaving it by an error removes what was written.

    Args:
        boundary: What separates the parts.
        target: Where the file goes; nothing is there yet.
        limit: Most bytes of the file.

    Raises:
        BadRequest: The boundary is not valid.
        StorageFull: No space is left.
    """

    def __init__(self, boundary: bytes, target: Path, limit: int) -> None:
        self._target = target
        self._limit = limit
        self._hash = hashlib.sha256()
        self._size = 0
        self._name: str | None = None
        self._fields: dict[str, bytearray] = {}
        self._header = (bytearray(), bytearray())
        self._disposition = b""
        self._into: bytearray | None = None
        self._field = ""
        self._parts = 0
        self._ended = False
        callbacks: MultipartCallbacks = {
            "on_part_begin": self._part_begins,
            "on_header_field": lambda data, start, end: self._header[0].extend(data[start:end]),
            "on_header_value": lambda data, start, end: self._header[1].extend(data[start:end]),
            "on_header_end": self._header_ends,
            "on_headers_finished": self._headers_end,
            "on_part_data": self._data,
            "on_end": self._end,
        }
        try:
            self._parser = MultipartParser(boundary, callbacks)
        except FormParserError as error:
            raise BadRequest("the boundary of the form is not valid") from error
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        with refused_when_full("run"):
            self._file = os.fdopen(os.open(target, flags, 0o600), "wb")

    def __enter__(self) -> Self:
        """The form itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; remove it on an error."""
        if kind is not None:
            self._target.unlink(missing_ok=True)
        try:
            self._file.close()
        except OSError:
            # Nothing is lost: an upload that is kept was written out in `finish`.
            self._target.unlink(missing_ok=True)

    def feed(self, chunk: bytes) -> None:
        """Take the next bytes of the body.

        Raises:
            BadRequest: The body is no form.
            BodyTooLarge: The file is larger than the limit.
            FieldRefused: A field is, or is none of `FIELDS`.
            StorageFull: No space is left.
        """
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise BadRequest("the form is broken; let the client make it") from error

    def finish(self) -> Upload:
        """What came in, once the body has ended; the file is on the disk.

        Raises:
            BadRequest: The form is not complete.
            FieldRefused: There is no file in it, or a field is no text.
            StorageFull: No space is left.
        """
        if not self._ended:
            raise BadRequest("the form ends in the middle; send it again")
        if self._name is None:
            raise FieldRefused("the form has no file; put the run in the field `file`", "file")
        with refused_when_full("run"):
            self._file.flush()
            os.fsync(self._file.fileno())
        return Upload(
            path=self._target,
            name=self._name,
            sha256=self._hash.hexdigest(),
            size=self._size,
            fields={name: _text(name, raw) for name, raw in self._fields.items()},
        )

    def _part_begins(self) -> None:
        self._parts += 1
        if self._parts > _MOST_PARTS:
            raise BadRequest(f"more than {_MOST_PARTS} parts; send one run in one form")
        self._disposition = b""
        self._into = None

    def _header_ends(self) -> None:
        name, value = self._header
        if name.lower() == b"content-disposition":
            self._disposition = bytes(value)
        self._header = (bytearray(), bytearray())

    def _headers_end(self) -> None:
        _, options = parse_options_header(self._disposition.decode("latin-1"))
        field = options.get(b"name", b"").decode("utf-8", "replace")
        if field == "file":
            if self._name is not None:
                raise FieldRefused("the form has two files; send one run in one form", "file")
            self._name = label(options.get(b"filename", b"").decode("utf-8", "replace"))
            self._into = None
        elif field not in FIELDS:
            raise FieldRefused(
                f"the form has a field that is none of file, {', '.join(FIELDS)}", label(field)
            )
        elif field in self._fields:
            raise FieldRefused(f"the form has the field {field} twice; keep one", field)
        else:
            self._field, self._into = field, self._fields.setdefault(field, bytearray())

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._into is not None:
            self._into += data[start:end]
            most = FIELDS[self._field]
            if len(self._into) > most:
                raise FieldRefused(
                    f"{self._field}: {len(self._into)} bytes or more; expected at most {most}; "
                    "shorten it, or the names in it",
                    self._field,
                )
            return
        self._size += end - start
        if self._size > self._limit:
            raise BodyTooLarge(
                f"the file has more than {self._limit} bytes; split the run or have the limit "
                "MOTORID_MAX_UPLOAD_BYTES raised"
            )
        view = memoryview(data)[start:end]
        self._hash.update(view)
        with refused_when_full("run"):
            self._file.write(view)

    def _end(self) -> None:
        self._ended = True


def _text(name: str, raw: bytearray) -> str:
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise FieldRefused(f"{name} is no text in UTF-8", name) from error
