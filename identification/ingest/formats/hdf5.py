"""Reader of HDF5 and of MATLAB files of version 7.3, with h5py.

Arrays of one group are a table; units stand in the attribute ``unit`` or ``units``.  Nothing
outside of the file is read: external links, external storage and virtual datasets are refused.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from identification.errors import FileTooLarge, UnsupportedContent
from identification.ingest.display import plain, quoted
from identification.ingest.file import RunFile
from identification.ingest.formats.library import decoding, imported
from identification.ingest.formats.matlab import decoded, has_objects, text_of
from identification.ingest.formats.tree import Leaf, Node, Opaque, tables_of
from identification.ingest.reader import TableSet

if TYPE_CHECKING:
    import h5py

__all__ = ["Hdf5Reader", "check_heaps"]

_WHAT: Final = "an HDF5 or MATLAB 7.3 file"
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_MATLAB = b"MATLAB 7.3 MAT"
# Files of other programs may begin with a block of their own.
_POSITIONS = (0, 512, 1024, 2048)
_LONGEST_TEXT = 1000
_CHUNK_BYTES = 8 << 20
# A collection of texts: signature, version 1, and its size.
_HEAP = b"GCOL\x01\0\0\0"
_HEAP_HEAD = struct.Struct("<8xQ")
_HEAP_OBJECT = struct.Struct("<H6xQ")
_LARGEST_HEAP = 1 << 20
_MOST_NODES = 100_000
_COLUMN_NAMES = ("columns", "column_names", "names", "labels")


class Hdf5Reader:
    """Reader of the numeric datasets of all groups."""

    def recognises(self, name: str, head: bytes) -> bool:
        """Return True for the signature of HDF5 at one of its usual positions."""
        return any(head[at:].startswith(_SIGNATURE) for at in _POSITIONS)

    def open(self, file: RunFile) -> TableSet:
        """List all datasets; their cells are read when their column is needed.

        Raises:
            UnsupportedContent: The file refers to other files.
        """
        library = imported("h5py", _WHAT)
        with decoding(_WHAT):
            stream = file.seekable()
            check_heaps(stream)
            opened = library.File(stream, "r")
            notes = ""
            root: Mapping[str, Node] = dict(_Tree(opened).members(opened))
            objects = [name for name, node in root.items() if has_objects(node)]
            if objects:
                dict(_Tree(opened, file.limits.bytes).members(opened))
                root, notes = decoded(root, stream, objects)
        is_matlab = file.head.startswith(_MATLAB) or objects
        return tables_of(root, file, "variable" if is_matlab else "group", notes)


def check_heaps(stream: BinaryIO) -> None:
    """Reject a global heap with free space of size 0, at which HDF5 loops without end.

    Texts of attributes are objects of global heaps (HDF5 File Format Specification, III.E).

    Raises:
        ValueError: A heap is damaged.
    """
    found, tail = [], b""
    while chunk := stream.read(_CHUNK_BYTES):
        window = tail + chunk
        start = stream.tell() - len(window)
        found += [start + match.start() for match in re.finditer(re.escape(_HEAP), window)]
        tail = window[1 - len(_HEAP) :]
    for place in found:
        stream.seek(place)
        heap = stream.read(_LARGEST_HEAP)
        end = min(len(heap), *_HEAP_HEAD.unpack_from(heap)) if len(heap) >= _HEAP_HEAD.size else 0
        at = _HEAP_HEAD.size
        while at + _HEAP_OBJECT.size <= end:
            index, size = _HEAP_OBJECT.unpack_from(heap, at)
            if index == size == 0:
                raise ValueError(f"the global heap at byte {place} is damaged")
            at += _HEAP_OBJECT.size + -(-size // 8) * 8 if index else size
    stream.seek(0)


@dataclass
class _Tree:
    """Conversion of groups and datasets to the nodes of a tree.

    With a limit of bytes, it also goes through the objects of MATLAB and what they refer to: mat-io
    reads all of it, wherever it is stored.
    """

    opened: h5py.File
    most_bytes: int | None = None
    bytes: int = 0
    nodes: int = 0
    open_groups: set[int] = field(default_factory=set)

    def members(self, group: h5py.Group) -> Iterator[tuple[str, Node]]:
        """Nodes of a group by name."""
        import h5py

        for name in group:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                target = f"a link to the file {quoted(link.filename)}"
                raise _outside(f"{group.name}/{name}", target)
            # The target of a soft link has a place of its own; MATLAB hides its objects behind #.
            is_hidden = name.startswith("#") and self.most_bytes is None
            if isinstance(link, h5py.HardLink) and not is_hidden:
                yield name, self._node(group[name])

    def _node(self, item: h5py.Group | h5py.Dataset) -> Node:
        import h5py

        self.nodes += 1
        if self.nodes > _MOST_NODES:
            raise FileTooLarge(
                f"more than {_MOST_NODES} groups and datasets; save only the channels of the run",
                value=self.nodes,
            )
        if "MATLAB_object_decode" in item.attrs and self.most_bytes is None:
            return Opaque(plain(text_of(item.attrs.get("MATLAB_class", ""))))
        if isinstance(item, h5py.Group):
            return self._group(item)
        if isinstance(item, h5py.Dataset) and "MATLAB_empty" not in item.attrs:
            return self._dataset(item)
        return ""

    def _group(self, group: h5py.Group) -> Node:
        import h5py

        address = h5py.h5o.get_info(group.id).addr
        if address in self.open_groups:
            # A group that contains itself.
            return ""
        self.open_groups.add(address)
        found = dict(self.members(group))
        self.open_groups.discard(address)
        lists = [child for child in found.values() if isinstance(child, list)]
        if lists and len(lists) == len(found) and len({len(one) for one in lists}) == 1:
            # MATLAB stores an array of structs as one list for each field.
            return [dict(zip(found, items, strict=True)) for items in zip(*lists, strict=True)]
        return found

    def _dataset(self, dataset: h5py.Dataset) -> Node:
        import h5py

        if dataset.external is not None:
            raise _outside(dataset.name, "data in another file")
        if dataset.is_virtual:
            raise _outside(dataset.name, "a virtual dataset of other files")
        self.bytes += dataset.size * dataset.dtype.itemsize
        if self.most_bytes is not None and self.bytes > self.most_bytes:
            raise FileTooLarge(
                f"the objects have more bytes than the limit of {self.most_bytes}; save only the "
                "channels of the run",
                value=self.bytes,
            )
        if h5py.check_ref_dtype(dataset.dtype) is not None:
            if dataset.size > _MOST_NODES:
                return ""
            return [self._node(self.opened[r]) for r in np.ravel(dataset[()]) if r]
        is_text = dataset.dtype.kind in "SO" and (dataset.ndim != 1 or dataset.size == 1)
        if text_of(dataset.attrs.get("MATLAB_class", "")) == "char" or is_text:
            return _string(dataset)
        if dataset.dtype.names:
            return {name: _leaf(dataset, name) for name in dataset.dtype.names}
        if dataset.dtype.kind not in "biufSO":
            return ""
        names = next((dataset.attrs[k] for k in _COLUMN_NAMES if k in dataset.attrs), None)
        if dataset.ndim == 2 and names is not None and len(names) == dataset.shape[1]:
            return {text_of(name): _leaf(dataset, k) for k, name in enumerate(names)}
        return _leaf(dataset)


def _leaf(dataset: h5py.Dataset, part: str | int | None = None) -> Leaf:
    """A dataset, one field of a compound one, or one column of a matrix."""
    unit = next((text_of(dataset.attrs[k]) for k in ("unit", "units") if k in dataset.attrs), "")
    # netCDF: "seconds since 2026-03-01".
    unit = unit.partition(" since ")[0]
    shape = dataset.shape if part is None else dataset.shape[:1]
    if part is None and "MATLAB_class" in dataset.attrs:
        shape = shape[::-1]
    is_text = dataset.dtype.kind in "SO"
    return Leaf(tuple(shape), partial(_cells, dataset, part), unit, is_text)


def _cells(dataset: h5py.Dataset, part: str | int | None) -> NDArray[np.generic]:
    with decoding(_WHAT):
        if isinstance(part, str) or dataset.dtype.kind in "SO":
            found = np.asarray(dataset[part or ()])
            is_text = found.dtype.kind in "SO"
            return np.array([*map(text_of, found)], dtype=object) if is_text else found
        if part is not None:
            return np.asarray(dataset[:, part])
        cells = np.asarray(dataset[()])
        # MATLAB stores columns first.
        return cells.T if "MATLAB_class" in dataset.attrs else cells


def _string(dataset: h5py.Dataset) -> str:
    if dataset.size != 1 and (dataset.dtype.kind in "SO" or dataset.size > _LONGEST_TEXT):
        return ""
    cells = np.ravel(dataset[()])
    if dataset.dtype.kind in "SO":
        return text_of(cells[0])
    return "".join(chr(code) for code in cells.tolist())


def _outside(name: str, what: str) -> UnsupportedContent:
    return UnsupportedContent(
        f"{quoted(name)} is {what}, and nothing outside of the file is read; copy the data into "
        "the file",
        value=name,
    )
