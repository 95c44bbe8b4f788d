"""Tables in a tree of named arrays: structs of MATLAB, logs of Simulink, groups of HDF5.

struct with fields that are vectors               a table; units in a field ``unit`` or ``units``
struct with ``time`` and ``signals``              a log of Simulink, "structure with time"
struct with ``Time`` and ``Data``                 an exported timeseries: one signal
struct with ``X`` and ``Y``                       a recording of dSPACE ControlDesk
``Channel_1_Data`` beside ``Channel_1_Header``    a channel of catman with its name and unit
vectors beside a number ``Tinterval``             a table, with the clock of a PicoScope
matrix ``yout``                                   the columns ``yout_1``, ``yout_2``, ...
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import FileTooLarge
from identification.ingest.clocks import Signal, SignalTable, joined
from identification.ingest.columns import describe_column
from identification.ingest.file import RunFile
from identification.ingest.reader import ColumnTable, SourceTable, TableSet, numbers, refuse_large
from identification.ingest.text.long import roles_of

__all__ = ["Leaf", "Node", "Opaque", "number_of", "tables_of"]

_TOP: Final = "workspace"
_MOST_NODES = 100_000
_SAVE = "save('run.mat', 'log')"
_EACH = (
    "for k = 1:{0}.numElements, e = {0}{{k}}; log.(matlab.lang.makeValidName(e.Name)) = "
    "struct('Time', e.Values.Time, 'Data', e.Values.Data); end, "
)
_COMMAND = f"log = struct('time_s', t, 'speed_rad_s', w) with the vectors of VAR; {_SAVE}"
# Commands of MATLAB that save the data of an object VAR as structs, by its class.
_COMMANDS = {
    "table": f"log = table2struct(VAR, 'ToScalar', true); {_SAVE}",
    "timetable": (
        "log = table2struct(timetable2table(VAR, 'ConvertRowTimes', false), 'ToScalar', true); "
        "log.time_s = seconds(VAR.Properties.RowTimes - VAR.Properties.RowTimes(1)); " + _SAVE
    ),
    "timeseries": f"log.NAME = struct('Time', VAR.Time, 'Data', VAR.Data); {_SAVE}",
    "Simulink.SimulationData.Dataset": _EACH.format("VAR") + _SAVE,
    "Simulink.SimulationOutput": _EACH.format("VAR.logsout") + _SAVE,
}
_DEEPEST = 20
_MOST_VECTORS = 64


@dataclass(frozen=True)
class Leaf:
    """Array of numbers or texts."""

    shape: tuple[int, ...]
    load: Callable[[], ArrayLike]
    unit: str = ""
    """Unit from its attributes; empty if there is none."""
    is_text: bool = False
    """True for texts, such as the names of a table with one signal per row."""

    @property
    def length(self) -> int:
        """Number of elements of a vector; 0 for a scalar or a matrix."""
        size = int(np.prod(self.shape)) if self.shape else 0
        return size if size > 1 and size == max(self.shape) else 0

    def vector(self) -> NDArray[np.generic]:
        """Cells of a vector in one dimension."""
        return np.ravel(np.asarray(self.load()))

    def column(self, index: int, axis: int = 1) -> NDArray[np.generic]:
        """Cells of one column of a matrix, or of one row with the axis 0."""
        return np.asarray(np.take(np.asarray(self.load()), index, axis))

    def vectors(self) -> list[Leaf]:
        """Columns of a matrix, or the rows of one with more columns than rows; at most 64."""
        if len(self.shape) != 2 or not 1 < min(self.shape) <= _MOST_VECTORS:
            return []
        count, axis = min(self.shape), int(np.argmin(self.shape))
        return [Leaf((max(self.shape),), partial(self.column, k, axis)) for k in range(count)]


@dataclass(frozen=True)
class Opaque:
    """Object that only MATLAB can decode, with the name of its class."""

    kind: str


Node: TypeAlias = "Mapping[str, Node] | list[Node] | Leaf | Opaque | str"


def tables_of(root: Mapping[str, Node], file: RunFile, kind: str, notes: str = "") -> TableSet:
    """Tables of a tree, and the signals with clocks of their own as one table.

    `kind` is the word for a table in messages; `notes` names content that is not read.

    Raises:
        FileTooLarge: The tree has more than 100,000 nodes.
    """
    walk = _Walk(file)
    walk.visit("", root, 0)
    tables: dict[str, SourceTable] = dict(walk.tables)
    for name, signals in walk.signals.items():
        shown = name if name not in tables else f"{name} (signals)"
        tables[shown] = SignalTable(signals, file.name)
    return TableSet(kind, tables, joined(walk.signals, file.name), walk.opaque_note() + notes)


@dataclass
class _Walk:
    """Search of a tree; it collects tables, signals and opaque objects by path."""

    file: RunFile
    tables: dict[str, ColumnTable] = field(default_factory=dict)
    signals: dict[str, list[Signal]] = field(default_factory=dict)
    opaque: dict[str, str] = field(default_factory=dict)
    nodes: int = 0

    def visit(self, path: str, node: Node, depth: int) -> None:
        """Collect the tables of a node and of the nodes below."""
        self.nodes += 1
        if self.nodes > _MOST_NODES or depth > _DEEPEST:
            raise FileTooLarge(
                f"more than {_MOST_NODES} variables or {_DEEPEST} levels of structs; save only "
                "the channels of the run",
                value=self.nodes,
            )
        if isinstance(node, Opaque):
            self.opaque[path] = node.kind
        elif isinstance(node, list):
            for number, item in enumerate(node, start=1):
                if isinstance(item, (Mapping, Opaque)):
                    self.visit(f"{path}({number})", item, depth + 1)
        elif isinstance(node, Mapping):
            self._visit_struct(path, node, depth)

    def _visit_struct(self, path: str, node: Mapping[str, Node], depth: int) -> None:
        keys = {key.casefold(): key for key in node}
        time = node.get(keys.get("time", ""))
        signals, data = (node.get(keys.get(key, "")) for key in ("signals", "data"))
        if isinstance(time, Leaf) and time.length and isinstance(signals, (Mapping, list)):
            self.signals.setdefault(path or _TOP, []).extend(self._logged(time, signals))
            return
        if isinstance(time, Leaf) and isinstance(data, Leaf) and data.length == time.length > 0:
            group, _, name = path.rpartition(".")
            title = node.get(keys.get("name", ""))
            named = title if isinstance(title, str) and title.strip() else name
            info = node.get(keys.get("datainfo", ""))
            unit = _unit(info) if isinstance(info, Mapping) else ""
            signal = self._signal(named, unit or _unit(node) or data.unit, time, data)
            self.signals.setdefault(group or _TOP, []).append(signal)
            return
        curves = _curves(node.get(keys.get("y", "")))
        if recorded := list(self._recorded(_curves(node.get(keys.get("x", ""))), curves)):
            self.signals.setdefault(path or _TOP, []).extend(recorded)
            return
        is_long = roles_of(list(node)) is not None
        vectors = {
            name: child
            for name, child in node.items()
            if isinstance(child, Leaf) and child.length and (is_long or not child.is_text)
        }
        vectors |= _clock(node, keys, vectors)
        vectors |= {
            f"{name}_{k}": vector
            for name, child in node.items()
            if isinstance(child, Leaf)
            for k, vector in enumerate(child.vectors(), 1)
        }
        if len(vectors) > 1:
            self.tables[path or _TOP] = self._table(vectors, _units(node), _headers(node))
        for name, child in node.items():
            self.visit(f"{path}.{name}" if path else name, child, depth + 1)

    def _table(
        self,
        vectors: Mapping[str, Leaf],
        units: Mapping[str, Node],
        headers: Mapping[str, tuple[str, str]],
    ) -> ColumnTable:
        columns, leaves = [], list(vectors.values())
        for index, (name, leaf) in enumerate(vectors.items()):
            unit = units.get(name)
            text = unit if isinstance(unit, str) else leaf.unit
            title, stated = headers.get(name, ("", ""))
            columns.append(describe_column(index, [title, name], [stated or text]))
        return ColumnTable(columns, lambda column: self._vector(leaves[column.index]))

    def _logged(self, time: Leaf, signals: Node) -> Iterator[Signal]:
        """Signals of a "structure with time"; a matrix gives one signal for each column."""
        for number, entry in enumerate(signals if isinstance(signals, list) else [signals], 1):
            values = entry.get("values") if isinstance(entry, Mapping) else None
            if not isinstance(entry, Mapping) or not isinstance(values, Leaf):
                continue
            label = next((t for k in ("label", "name") if isinstance(t := entry.get(k), str)), "")
            name = label.strip() or f"signal {number}"
            if values.length == time.length:
                yield self._signal(name, _unit(entry), time, values)
            elif len(values.shape) == 2 and values.shape[0] == time.length:
                for k in range(values.shape[1]):
                    leaf = Leaf((time.length,), partial(values.column, k))
                    yield self._signal(f"{name}({k + 1})", _unit(entry), time, leaf)

    def _recorded(self, axes: list[_Curve], curves: list[_Curve]) -> Iterator[Signal]:
        """Signals of a recording, each with the axis whose number, from 1, it states."""
        titles = Counter(curve.name for curve in curves)
        for curve in curves:
            number = 1 if len(axes) == 1 else curve.axis
            if not 1 <= number <= len(axes):
                continue
            time = axes[number - 1]
            if time.unit in ("", "s") and time.data.length == curve.data.length > 0:
                signal = self._signal(curve.name, curve.unit, time.data, curve.data)
                # The ports of different blocks have one name.
                is_repeated = titles[curve.name] > 1 and curve.path
                names = (curve.path, curve.name) if is_repeated else signal.names
                yield replace(signal, names=names)

    def _signal(self, name: str, unit: str, time: Leaf, data: Leaf) -> Signal:
        # Simulink counts the times of a log in seconds.
        column = describe_column(0, ["time"], ["s"])
        clock = cache(lambda: numbers(self._vector(time), column))
        return Signal((name,), unit, clock, partial(self._vector, data))

    def _vector(self, leaf: Leaf) -> NDArray[np.generic]:
        refuse_large(self.file.limits, leaf.length)
        return leaf.vector()

    def opaque_note(self) -> str:
        """Objects that were left out, and what to save in their place."""
        if not self.opaque:
            return ""
        listed = ", ".join(f"{path} ({kind})" for path, kind in list(self.opaque.items())[:6])
        commands = dict.fromkeys(
            # MATLAB writes the path of an object like this if it is one of names.
            _COMMANDS.get(kind, _COMMAND).replace(
                "VAR", path if all(map(str.isidentifier, path.split("."))) else "x"
            )
            for path, kind in self.opaque.items()
        )
        return (
            f"; {listed} cannot be read outside MATLAB; save a struct of vectors there: "
            + " or ".join(list(commands)[:2])
        )


@dataclass(frozen=True)
class _Curve:
    """Axis or curve of a recording of dSPACE."""

    name: str
    path: str
    unit: str
    data: Leaf
    axis: int
    """Number of its axis, from 1; 0 where none is stated."""


def _curves(node: Node | None) -> list[_Curve]:
    """Elements ``X`` or ``Y`` of a recording; empty if one of them is no curve."""
    found = []
    for entry in node if isinstance(node, list) else [node]:
        fields = {k.casefold(): v for k, v in entry.items()} if isinstance(entry, Mapping) else {}
        data = fields.get("data")
        # Two timeseries x and y have times of their own.
        if not isinstance(data, Leaf) or "time" in fields:
            return []
        name, path = (v if isinstance(v := fields.get(k), str) else "" for k in ("name", "path"))
        axis = number_of(fields.get("xindex"))
        number = int(axis) if axis.is_integer() else 0
        found.append(_Curve(name.strip(), path.strip(), _unit(fields), data, number))
    return found


def _headers(node: Mapping[str, Node]) -> dict[str, tuple[str, str]]:
    """Name and unit of the vectors that have a struct with them beside, as catman saves them."""
    found = {}
    for key, header in node.items():
        stem, end, rest = key.partition("_Header")
        if end and not rest and isinstance(header, Mapping):
            name = header.get("SignalName")
            found[f"{stem}_Data"] = (name if isinstance(name, str) else "", _unit(header))
    return found


def _clock(
    node: Mapping[str, Node], keys: Mapping[str, str], vectors: Mapping[str, Leaf]
) -> dict[str, Leaf]:
    """Times of vectors of one length, from the start and the interval [s] that PicoScope stores."""
    step, start = (number_of(node.get(keys.get(key, ""))) for key in ("tinterval", "tstart"))
    lengths = {vector.length for vector in vectors.values()}
    if not step > 0.0 or "time" in keys or len(lengths) != 1:
        return {}
    [length] = lengths
    first = start if np.isfinite(start) else 0.0
    return {"time": Leaf((length,), lambda: first + step * np.arange(length), "s")}


def number_of(node: Node | None) -> float:
    """Value of a number; NaN for anything else."""
    if isinstance(node, Leaf) and int(np.prod(node.shape)) == 1:
        return float(np.ravel(np.asarray(node.load(), dtype=np.float64))[0])
    return float("nan")


def _unit_fields(node: Mapping[str, Node]) -> list[Node]:
    return [child for name, child in node.items() if name.casefold() in ("unit", "units")]


def _units(node: Mapping[str, Node]) -> Mapping[str, Node]:
    """Field with the unit of each other field."""
    return next((child for child in _unit_fields(node) if isinstance(child, Mapping)), {})


def _unit(node: Mapping[str, Node]) -> str:
    return next((child.strip() for child in _unit_fields(node) if isinstance(child, str)), "")
