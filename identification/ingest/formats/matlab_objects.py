"""Objects of MATLAB (tables, timetables, timeseries, logs of Simulink), with mat-io.

MATLAB stores the properties of objects in an undocumented part of the file, which mat-io decodes.
Tables and timetables become structs of vectors with units, and the properties of a timeseries the
struct with ``Time`` and ``Data`` that `tree` knows.  A timeseries may store its times as start and
increment.  Any other object remains opaque, and the error names the commands that save its data.
"""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Mapping, Sequence
from functools import partial
from typing import BinaryIO, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from identification.errors import DamagedFile
from identification.ingest.display import plain
from identification.ingest.formats.library import decoding, imported
from identification.ingest.formats.tree import Leaf, Node, Opaque

__all__ = ["decoded", "has_objects", "node_of"]

_WHAT: Final = "a MATLAB file with objects"
_LIBRARY: Final = "matio"
_DEEPEST = 20
_METADATA = ("tsdata.timemetadata", "tsdata.datametadata")
_TIME_UNITS = {"seconds": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "minutes": 60.0}


def has_objects(node: Node) -> bool:
    """Whether a node or one below it is an object."""
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
    try:
        found = _objects(stream.name, names)
        # Without its properties, mat-io returns an object as the scalar that refers to them.
        kept = {k: node for k, node in found.items() if not isinstance(node, Leaf) or node.length}
        return {**root, **kept}, ""
    except DamagedFile:
        return root, "; the library mat-io cannot decode these objects"


def _objects(path: str, names: Sequence[str] | None) -> Mapping[str, Node]:
    library = imported(_LIBRARY, _WHAT)
    faults = imported("matio.utils.matclass", _WHAT)
    with decoding(_WHAT, (faults.MatReadError, faults.MatConvertError)):
        content = library.load_from_mat(
            path, variable_names=None if names is None else list(names), add_table_attrs=True
        )
        return {
            plain(str(name)): node_of(value)
            for name, value in content.items()
            if not str(name).startswith("__")
        }


def node_of(value: object, depth: int = 0) -> Node:
    """One variable, field or property as a node of a tree."""
    if depth > _DEEPEST:
        return ""
    if isinstance(value, pd.DataFrame):
        return _table(value)
    if not isinstance(value, np.ndarray):
        kind, properties = (getattr(value, name, None) for name in ("classname", "properties"))
        if kind is None:
            return value if isinstance(value, str) else ""
        found = _object(str(kind), properties, depth) if isinstance(properties, Mapping) else ""
        return found or Opaque(plain(str(kind)))
    if value.dtype.names:
        return _single([_fields(record, depth) for record in value.ravel()])
    if value.dtype.kind == "O":
        return _single([node_of(child, depth + 1) for child in value.ravel()])
    if value.dtype.kind in "UT":
        return str(value.ravel()[0]) if value.size == 1 else ""
    return _leaf(value) if value.dtype.kind in "biufmM" else ""


def _single(nodes: list[Node]) -> Node:
    return nodes[0] if len(nodes) == 1 else nodes


def _fields(record: np.void, depth: int) -> Node:
    return {str(name): node_of(record[name], depth + 1) for name in record.dtype.names or ()}


def _leaf(cells: NDArray[np.generic], unit: str = "") -> Leaf:
    # Dates and durations become seconds when they are read.
    return Leaf(cells.shape, partial(np.asarray, cells), "s" if cells.dtype.kind in "mM" else unit)


def _table(table: pd.DataFrame) -> Node:
    """Columns of a table, and the times of the rows of a timetable."""
    units = table.attrs.get("varUnits") or table.attrs.get("VariableUnits") or []
    # A matrix as a variable becomes several columns, and the units no longer belong to them.
    known = map(str, units) if len(units) == table.shape[1] else [""] * table.shape[1]
    columns = zip(map(str, table.columns), known, strict=True)
    found: dict[str, Node] = {}
    if table.index.dtype.kind in "mM":
        found["Time" if table.index.name is None else str(table.index.name)] = _leaf(
            table.index.to_numpy()
        )
    for place, (name, unit) in enumerate(columns):
        cells = np.asarray(table.iloc[:, place])
        if cells.dtype.kind in "biufmM":
            found[name] = _leaf(cells, unit)
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
        return _named(nodes["Values"], nodes.get("Name", ""))
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
        start, step, count = (_scalar(about.get(k)) for k in ("Start", "Increment", "Length"))
        if start is None or step is None or not step > 0.0 or count != data.length:
            return ""
        seconds = (start + np.arange(data.length) * step) * factor
    else:
        seconds = np.asarray(time.vector(), dtype=np.float64) * factor
    if seconds.size != data.length:
        return ""
    kept = {key: nodes[key] for key in ("Name", "DataInfo") if key in nodes}
    return {**kept, "Time": _leaf(seconds), "Data": data}


def _named(values: Node, name: Node) -> Node:
    """The signal of a log under the name that the log gives."""
    if isinstance(values, Mapping) and "Data" in values and isinstance(name, str) and name.strip():
        return {**values, "Name": name}
    return values if _has_samples(values) else ""


def _has_samples(node: Node) -> bool:
    if isinstance(node, Leaf):
        return node.length > 0
    if isinstance(node, Mapping):
        return any(map(_has_samples, node.values()))
    return isinstance(node, list) and any(map(_has_samples, node))


def _scalar(node: Node | None) -> float | None:
    if isinstance(node, Leaf) and int(np.prod(node.shape)) == 1:
        return float(np.asarray(node.load(), dtype=np.float64).ravel()[0])
    return None
