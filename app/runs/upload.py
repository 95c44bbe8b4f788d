"""Streaming parser for uploads as multipart/form-data.

The form is parsed while it arrives, and the file is hashed and written directly to the data
directory.  An upload of any size therefore needs only a few hundred kilobytes of memory.  The file
name given by the caller is a label and never a path.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from app.errors import BadRequest, BodyTooLarge, FieldRefused, WrongMediaType
from app.storage import refused_when_full

if TYPE_CHECKING:
    from python_multipart.multipart import MultipartCallbacks

__all__ = ["FIELDS", "LONGEST_FIELD", "Upload", "UploadForm", "boundary_of", "label"]

LONGEST_FIELD: Final = 10_000
FIELDS: Final = {"motor": LONGEST_FIELD, "mapping": LONGEST_FIELD}
"""Form fields in addition to `file`, with the maximum size of each [bytes].

A mapping has one entry for each of six channels; a fit takes 400 runs with one mapping each.
"""

_LONGEST_LABEL = 200
_LONGEST_HEADER = 4_000
"""Maximum size of a header of a part, which includes the name of the file [bytes]."""
_MOST_PARTS = 10


@dataclass(frozen=True)
class Upload:
    """A form that was received completely."""

    path: Path
    name: str
    """File name given by the caller, without directories."""
    sha256: str
    size: int
    """Size of the file [bytes]."""
    fields: dict[str, str]
    """The other fields of the form."""


def boundary_of(content_type: str) -> bytes:
    """Boundary between the parts of a multipart form.

    Raises:
        WrongMediaType: The body is not a multipart form.
        BadRequest: The Content-Type has no boundary.
    """
    kind, options = parse_options_header(content_type)
    if kind != b"multipart/form-data":
        raise WrongMediaType("expected multipart/form-data with the run in the field `file`")
    boundary = options.get(b"boundary", b"")
    if not boundary:
        raise BadRequest("the Content-Type has no boundary; let the HTTP client generate it")
    return boundary


def label(name: str) -> str:
    """Last component of a file name, printable and of limited length."""
    last = name.replace("\\", "/").rstrip("/").rpartition("/")[2]
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in last).strip()
    return shown[-_LONGEST_LABEL:] or "run"


class UploadForm:
    """Parser of a form while it arrives, into a file that does not exist yet.

    The file and the fields accepted besides it have maximum sizes [bytes].

    As a context manager, it deletes the written file if an exception occurs.

    `BadRequest` is raised for a boundary or a body that is no valid form, `BodyTooLarge` for a file
    above its maximum size, `FieldRefused` for a field that is missing, too large, not accepted,
    given twice or not UTF-8 text, and `StorageFull` if no disk space is left.
    """

    def __init__(
        self, boundary: bytes, target: Path, limit: int, accepted: Mapping[str, int] = FIELDS
    ) -> None:
        self._accepted = accepted
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
            "on_header_field": lambda *part: self._header_data(self._header[0], *part),
            "on_header_value": lambda *part: self._header_data(self._header[1], *part),
            "on_header_end": self._header_ends,
            "on_headers_finished": self._headers_end,
            "on_part_data": self._data,
            "on_end": self._end,
        }
        try:
            self._parser = MultipartParser(boundary, callbacks, max_header_size=sys.maxsize)
        except FormParserError as error:
            raise BadRequest("the boundary of the form is invalid") from error
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        with refused_when_full("run"):
            self._file = os.fdopen(os.open(target, flags, 0o600), "wb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        """Close the file; delete it after an exception."""
        if kind is not None:
            self._target.unlink(missing_ok=True)
        try:
            self._file.close()
        except OSError:
            # No data are lost: `finish` has already flushed an upload that is kept.
            self._target.unlink(missing_ok=True)

    def feed(self, chunk: bytes) -> None:
        """Parse the next bytes of the body."""
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise BadRequest("the form is malformed; let the HTTP client generate it") from error

    def finish(self) -> Upload:
        """Return the form at the end of the body, after flushing the file to disk."""
        if not self._ended:
            raise BadRequest("the form is incomplete; send it again")
        if self._name is None:
            raise FieldRefused("the form has no file; send the run in the field `file`", "file")
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
            raise BadRequest(f"the form has more than {_MOST_PARTS} parts; send one run per form")
        self._disposition = b""
        self._into = None

    def _header_data(self, received: bytearray, data: bytes, start: int, end: int) -> None:
        received += data[start:end]
        if len(received) > _LONGEST_HEADER:
            raise FieldRefused(
                f"the name of the file is too long: its header has at least {len(received)} bytes; "
                f"expected at most {_LONGEST_HEADER}; shorten the name",
                "file",
            )

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
                raise FieldRefused("the form has two files; send one run per form", "file")
            # Browsers write a quotation mark of the name as %22 (WHATWG HTML, multipart/form-data).
            name = options.get(b"filename", b"").replace(b"%22", b'"')
            self._name = label(name.decode("utf-8", "replace"))
            self._into = None
        elif field not in self._accepted:
            raise FieldRefused(
                f"the form has an unknown field; expected file, {', '.join(self._accepted)}",
                label(field),
            )
        elif field in self._fields:
            raise FieldRefused(f"the form has the field {field} twice; keep one", field)
        else:
            self._field, self._into = field, self._fields.setdefault(field, bytearray())

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._into is not None:
            self._into += data[start:end]
            most = self._accepted[self._field]
            if len(self._into) > most:
                raise FieldRefused(
                    f"{self._field}: at least {len(self._into)} bytes; expected at most {most}; "
                    "shorten the field",
                    self._field,
                )
            return
        self._size += end - start
        if self._size > self._limit:
            raise BodyTooLarge(
                f"the file has more than {self._limit} bytes; split the run, or ask the operator "
                "to raise MOTORID_MAX_UPLOAD_BYTES"
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
        raise FieldRefused(f"{name} is not UTF-8 text", name) from error
