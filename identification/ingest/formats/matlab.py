"""Reader of MATLAB files of version 5 (up to -v7), with scipy; version 7.3 is HDF5."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import BinaryIO, Final

import numpy as np

from identification.errors import FileTooLarge
from identification.ingest.display import plain
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.formats.tree import Leaf, Node, Opaque, tables_of
from identification.ingest.reader import TableSet

__all__ = ["MatlabReader"]

_WHAT: Final = "a MATLAB file"
_NUMBER_BYTES = 8


class MatlabReader:
    """Reader of the numeric variables and structs of a MATLAB file."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for the text at the beginning of a MATLAB file of version 5."""
        return head.startswith(b"MATLAB 5.0 MAT")

    def open(self, file: RunFile) -> TableSet:
        """Read all variables, after a look at their declared sizes.

        Raises:
            FileTooLarge: The variables are larger than the limit of bytes.
        """
        library = imported("scipy.io", _WHAT)
        stream = file.seekable()
        with decoding(_WHAT, (library.matlab.MatReadError,)):
            size = _declared_bytes(library.whosmat, stream)
            if size > file.limits.bytes:
                raise FileTooLarge(
                    f"the variables have {size} bytes, more than the limit of {file.limits.bytes}; "
                    "save only the channels of the run",
                    value=size,
                )
            stream.seek(0)
            content = library.loadmat(stream, simplify_cells=True)
        root = {
            _name(name, value): _node(value)
            for name, value in content.items()
            if not name.startswith("__")
        }
        return tables_of(root, file, "variable")


def _declared_bytes(
    whosmat: Callable[[BinaryIO], list[tuple[str, tuple[int, ...], str]]], stream: BinaryIO
) -> int:
    """Size of all variables as declared; 0 beside an opaque object, at which scipy fails."""
    try:
        shapes = [shape for _, shape, _ in whosmat(stream)]
    except TypeError:
        return 0
    return sum(math.prod(map(int, shape)) for shape in shapes) * _NUMBER_BYTES


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
        return [_node(child) for child in cells.ravel().tolist()]
    if cells.dtype.kind not in "biuf":
        return ""
    return Leaf(cells.shape, partial(np.asarray, cells))


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
