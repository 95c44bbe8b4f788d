"""Reader of MATLAB files of versions 4 and 5 (-v4, -v6, -v7), with scipy; version 7.3 is HDF5.

A file with objects (tables, timetables, timeseries, logs of Simulink) is read again with mat-io.
MATLAB stores the properties of objects in an undocumented part of the file, which mat-io decodes.
Tables and timetables become structs of vectors with units, and the properties of a timeseries the
struct with ``Time`` and ``Data`` that `tree` knows.  A timeseries may store its times as start and
increment.  Any other object remains opaque, and the error names the commands that save its data.
"""

from __future__ import annotations

import importlib.util
import io
import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from functools import partial
from typing import BinaryIO, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.errors import DamagedFile, FileTooLarge
from identification.ingest.display import plain
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.formats.tree import Leaf, Node, Opaque, number_of, tables_of
from identification.ingest.reader import TableSet

__all__ = ["MatlabReader", "decoded", "has_objects", "node_of", "text_of"]

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

_OBJECTS: Final = "a MATLAB file with objects"
_LIBRARY: Final = "matio"
_DEEPEST = 20
_METADATA = ("tsdata.timemetadata", "tsdata.datametadata")
_TIME_UNITS = {"seconds": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "minutes": 60.0}


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
            content = library.loadmat(stream, squeeze_me=True)
        root: dict[str, Node] = {}
        for name, value in content.items():
            if isinstance(value, library.matlab.MatlabOpaque):
                # scipy keeps the name of an object in the field s0 of its record.
                root[plain(text_of(value["s0"].ravel()[0]))] = node_of(value)
            elif not name.startswith("__"):
                root[name] = node_of(value)
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


def has_objects(node: Node) -> bool:
    """True if a node or one below it is an object."""
    if isinstance(node, Mapping):
        return any(map(has_objects, node.values()))
    return any(map(has_objects, node)) if isinstance(node, list) else isinstance(node, Opaque)


def decoded(
    root: Mapping[str, Node], stream: BinaryIO, names: Sequence[str] | None = None
) -> tuple[Mapping[str, Node], str]:
    """Decode the named or all objects of an open file; the text says why, if they are not decoded.

    mat-io opens the file again by its name.
    """
    if importlib.util.find_spec(_LIBRARY) is None:
        return root, (
            "; tables, timetables and logs are read with the library mat-io: "
            "pip install 'motorid[formats]'"
        )
    if not isinstance(stream, io.BufferedReader):
        return root, "; tables, timetables and logs are not read from compressed files: unpack it"
    library = imported(_LIBRARY, _OBJECTS)
    faults = imported("matio.utils.matclass", _OBJECTS)
    wanted = None if names is None else list(names)
    try:
        with decoding(_OBJECTS, (faults.MatReadError, faults.MatConvertError)):
            content = library.load_from_mat(
                stream.name, variable_names=wanted, add_table_attrs=True
            )
            found = {
                plain(str(name)): node_of(value)
                for name, value in content.items()
                if not str(name).startswith("__")
            }
    except DamagedFile:
        return root, "; the library mat-io cannot decode these objects"
    # Without its properties, mat-io returns an object as the scalar that refers to them.
    kept = {k: node for k, node in found.items() if not isinstance(node, Leaf) or node.length}
    return {**root, **kept}, ""


def node_of(value: object, depth: int = 0) -> Node:
    """One variable, field or property as a node of a tree."""
    from scipy.io.matlab import MatlabFunction, MatlabOpaque

    if depth > _DEEPEST:
        return ""
    if isinstance(value, pd.DataFrame):
        return _table(value)
    if isinstance(value, MatlabOpaque):
        # scipy does not decode an object; the field s2 of its record is the name of the class.
        return Opaque(plain(text_of(value["s2"].ravel()[0])))
    if isinstance(value, (int, float)):
        # scipy gives a variable of one number as a number of Python.
        return _leaf(np.asarray(value))
    if not isinstance(value, np.ndarray) or isinstance(value, MatlabFunction):
        kind, properties = (getattr(value, name, None) for name in ("classname", "properties"))
        if kind is None:
            return value if isinstance(value, str) else ""
        found = _object(str(kind), properties, depth) if isinstance(properties, Mapping) else ""
        return found or Opaque(plain(str(kind)))
    if value.dtype.names or value.dtype.kind == "O":
        nodes: list[Node] = [
            {str(name): node_of(item[name], depth + 1) for name in value.dtype.names}
            if value.dtype.names
            else node_of(item, depth + 1)
            for item in value.ravel()
        ]
        return nodes[0] if len(nodes) == 1 else nodes
    if value.dtype.kind in "UT":
        return str(value.ravel()[0]) if value.size == 1 else ""
    return _leaf(value) if value.dtype.kind in "biufmM" else ""


def text_of(value: object) -> str:
    """Text that a library may return as bytes."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _leaf(cells: NDArray[np.generic], unit: str = "") -> Leaf:
    # Dates and durations become seconds when they are read.
    return Leaf(cells.shape, partial(np.asarray, cells), "s" if cells.dtype.kind in "mM" else unit)


def _table(table: pd.DataFrame) -> Node:
    """Columns of a table, and the times of the rows of a timetable."""
    units = table.attrs.get("varUnits") or table.attrs.get("VariableUnits") or []
    # A matrix as a variable becomes several columns, and the units no longer belong to them.
    known = map(str, units) if len(units) == table.shape[1] else [""] * table.shape[1]
    found: dict[str, Node] = {}
    if table.index.dtype.kind in "mM":
        name = "Time" if table.index.name is None else str(table.index.name)
        found[name] = _leaf(table.index.to_numpy())
    for (column, values), unit in zip(table.items(), known, strict=True):
        cells = np.asarray(values)
        if cells.dtype.kind in "biufmM":
            found[str(column)] = _leaf(cells, unit)
    return found


def _object(kind: str, properties: Mapping[object, object], depth: int) -> Node:
    """Signals or tables in the properties of an object; "" if there are none."""
    nodes: dict[str, Node] = {}
    for name, value in properties.items():
        # A stored property ends with an underscore; that without one is then empty.
        key, node = str(name).rstrip("_"), node_of(value, depth + 1)
        if key not in nodes or _has_samples(node):
            nodes[key] = node
    if kind in _METADATA:
        return nodes
    if kind == "Simulink.SimulationData.Unit":
        return nodes.get("Name", "")
    if kind == "timeseries":
        return _timeseries(nodes)
    if "Values" in nodes:
        # The signal of a log has the name that the log gives.
        values, name = nodes["Values"], nodes.get("Name", "")
        has_name = isinstance(name, str) and name.strip()
        if isinstance(values, Mapping) and "Data" in values and has_name:
            return {**values, "Name": name}
        return values if _has_samples(values) else ""
    # Vectors that are properties of an unknown class may be anything.
    inner = [node for node in nodes.values() if isinstance(node, (Mapping, list))]
    return nodes if any(map(_has_samples, inner)) else ""


def _timeseries(nodes: Mapping[str, Node]) -> Node:
    """Struct with the times and samples of a timeseries, or "" if they are not understood."""
    data, time, about = (nodes.get(key) for key in ("Data", "Time", "TimeInfo"))
    if not isinstance(data, Leaf) or not data.length or not isinstance(about, Mapping):
        return ""
    unit = about.get("Units")
    factor = _TIME_UNITS.get(unit) if isinstance(unit, str) else None
    if factor is None:
        return ""
    if not isinstance(time, Leaf) or not time.length:
        start, step, count = (number_of(about.get(k)) for k in ("Start", "Increment", "Length"))
        if math.isnan(start) or not step > 0.0 or count != data.length:
            return ""
        seconds = (start + np.arange(data.length) * step) * factor
    else:
        seconds = np.asarray(time.vector(), dtype=np.float64) * factor
    if seconds.size != data.length:
        return ""
    kept = {key: nodes[key] for key in ("Name", "DataInfo") if key in nodes}
    return {**kept, "Time": _leaf(seconds), "Data": data}


def _has_samples(node: Node) -> bool:
    if isinstance(node, Leaf):
        return node.length > 0
    if isinstance(node, Mapping):
        return any(map(_has_samples, node.values()))
    return isinstance(node, list) and any(map(_has_samples, node))
