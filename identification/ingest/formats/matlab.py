"""Reader of MATLAB files of versions 4 and 5 (-v4, -v6, -v7), with scipy; version 7.3 is HDF5.

A file with objects, such as timetables, is read again with mat-io.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from functools import partial
from typing import BinaryIO, Final

import numpy as np

from identification.errors import FileTooLarge
from identification.ingest.display import plain
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.formats.matlab_objects import decoded, has_objects
from identification.ingest.formats.tree import Leaf, Node, Opaque, tables_of
from identification.ingest.reader import TableSet

__all__ = ["MatlabReader"]

_WHAT: Final = "a MATLAB file"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEADER_BYTES = 128
_COMPRESSED = 15
# Deflate compresses to no less than 1 / 1032.
_LARGEST_RATIO = 1032
_ORDERS = {b"IM": "<II", b"MI": ">II"}
# Head of a variable of version 4: MOPT, rows, columns, imaginary flag, length of the name.
_HEADS_4 = (struct.Struct("<5i"), struct.Struct(">5i"))
_LONGEST_NAME = 64


class MatlabReader:
    """Reader of the numeric variables and structs of a MATLAB file."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for the text of version 5, or the first variable of version 4."""
        is_5 = head.startswith(b"MATLAB 5.0 MAT") and not head[512:].startswith(_HDF5)
        return is_5 or _is_version_4(head)

    def open(self, file: RunFile) -> TableSet:
        """Read all variables, after a look at their declared sizes.

        Raises:
            FileTooLarge: The variables are larger than the limit of bytes.
        """
        library = imported("scipy.io", _WHAT)
        stream = file.seekable()
        with decoding(_WHAT, (library.matlab.MatReadError,)):
            # Version 4 has no compression, so its variables are not larger than the file.
            size = 0 if _is_version_4(file.head) else _declared_bytes(stream)
            if size > file.limits.bytes:
                raise FileTooLarge(
                    f"the variables have {size} bytes, more than the limit of {file.limits.bytes}; "
                    "save only the channels of the run",
                    value=size,
                )
            stream.seek(0)
            content = library.loadmat(stream, simplify_cells=True)
        root: dict[str, Node] = {
            _name(name, value): _node(value)
            for name, value in content.items()
            if not name.startswith("__")
        }
        tree, notes = decoded(root, stream) if has_objects(root) else (root, "")
        return tables_of(tree, file, "variable", notes)


def _is_version_4(head: bytes) -> bool:
    """Return True for the head of a numeric, text or sparse matrix and its name.

    MATLAB MAT-File Format, 1-36: the decimal digits of MOPT are the byte order (0 little-endian, 1
    big-endian), 0, the type of the numbers (0 to 5) and the type of the matrix (0 to 2).
    """
    for order, layout in enumerate(_HEADS_4):
        if len(head) <= layout.size:
            return False
        kind, rows, columns, imaginary, length = layout.unpack_from(head)
        name = head[layout.size : layout.size + length]
        if (
            kind in range(1000 * order, 1000 * order + 60)
            and kind % 10 <= 2
            and min(rows, columns) >= 0
            and imaginary in (0, 1)
            and 1 < length <= _LONGEST_NAME
            and name.rstrip(b"\0").decode("ascii", "replace").isidentifier()
        ):
            return True
    return False


def _declared_bytes(stream: BinaryIO) -> int:
    """Size of all variables without compression, as declared in their tags.

    MATLAB MAT-File Format, 1-4: a tag is the kind of data and its size; a compressed element
    contains the tag of its content.

    Raises:
        ValueError: A variable ends behind the file, or is larger than its compression allows.
    """
    end = stream.seek(0, 2)
    stream.seek(0)
    order = _ORDERS.get(stream.read(_HEADER_BYTES)[-2:], "<II")
    total = 0
    while len(tag := stream.read(8)) == 8:
        kind, size = struct.unpack(order, tag)
        following = stream.tell() + size
        if following > end:
            raise ValueError(f"a variable ends at byte {following} of {end}")
        if kind == _COMPRESSED:
            content = zlib.decompressobj().decompress(stream.read(min(size, 1024)), 8)
            packed, size = size, struct.unpack(order, content)[1] if len(content) == 8 else 0
            if size > _LARGEST_RATIO * packed:
                raise ValueError(f"a variable of {size} bytes is compressed to {packed}")
        total += size
        stream.seek(following)
    stream.seek(0)
    return total


def _name(name: str, value: object) -> str:
    """Name of a variable; scipy keeps that of an opaque object in the field s0 of its record."""
    if isinstance(value, np.ndarray) and "s0" in (value.dtype.names or ()):
        return plain(_text(value["s0"].ravel()[0]))
    return name


def _node(value: object) -> Node:
    """One variable or field as a node of a tree."""
    if isinstance(value, Mapping):
        return {str(name): _node(child) for name, child in value.items()}
    if isinstance(value, list):
        return [_node(child) for child in value]
    if isinstance(value, str):
        return value
    cells = np.asarray(value)
    names = cells.dtype.names or ()
    if "s2" in names:
        # scipy returns an opaque object as a record whose field s2 is the name of the class.
        return Opaque(plain(_text(cells["s2"].ravel()[0])))
    if cells.dtype.kind == "O":
        # A sparse matrix and a function handle have no dimensions here, and are no channels.
        return [_node(child) for child in cells.ravel().tolist()] if cells.ndim else ""
    if cells.dtype.kind not in "biuf":
        return ""
    return Leaf(cells.shape, partial(np.asarray, cells))


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
