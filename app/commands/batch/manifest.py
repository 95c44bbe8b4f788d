"""Manifest of a batch: motors with their run files and options, as CSV or YAML.

    motor,type,training,validation,seed
    pump-17,RE40,pump17/run1.csv;pump17/run2.csv,pump17/check.csv,3

    options: {posterior: false}
    motors:
      - motor: pump-17
        type: RE40
        training: [pump17/run1.csv, pump17/run2.csv]
        validation: [pump17/check.csv]
        mapping: pump17/columns.json
        options: {seed: 3}

A file name that ends with .yaml or .yml selects YAML, any other name CSV.  Paths are relative to
the manifest, and wildcards such as run*.csv stand for all files that match.  Options of a motor
override the common options of the manifest, which override those of the command line.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from glob import glob, has_magic
from os.path import lexists
from pathlib import Path
from typing import Any, Final

import yaml

from app.commands.batch.options import Place, option_of, options_with
from identification.errors import InputError, UnreadableFile
from identification.label import Label
from identification.options import FitOptions

__all__ = ["Motor", "read_manifest", "unopened"]

_FILES: Final = ("training", "validation")
_FIELDS: Final = ("motor", *_FILES, "mapping", "bench", "type")
_OPTIONS: Final = tuple(FitOptions.__dataclass_fields__)
# The motor name is used as a directory name.
_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]{0,99}")
# The batch writes its own files to the same directory.
_RESERVED: Final = frozenset(
    {"results.csv", "results.parquet", "pooled.csv", "fleet.html", "service.json"}
)
_LONGEST_TYPE: Final = 100
_LARGEST_BYTES: Final = 20_000_000
_LONGEST_SCALAR: Final = 10_000


@dataclass(frozen=True)
class Motor:
    """One motor of a manifest."""

    name: str
    """Name of the motor and of its output directory."""
    training: tuple[Path, ...]
    """Training run files, in the order of recording."""
    validation: tuple[Path, ...]
    options: FitOptions
    mapping: Path | None = None
    """JSON file that assigns columns to channels, or None."""
    bench: str = ""
    """Name of the test bench; empty if unknown."""
    type: str = ""
    """Type of the motor; empty if the manifest gives none."""


def read_manifest(path: Path, defaults: FitOptions) -> list[Motor]:
    """Read the motors of a manifest.

    Raises:
        InputError: The file cannot be read, or an entry is invalid.
    """
    text = _text(path)
    is_yaml = path.suffix.lower() in (".yaml", ".yml")
    motors: dict[str, Motor] = {}
    for row, motor in (_of_yaml if is_yaml else _of_csv)(text, path, defaults):
        if motor.name in motors:
            raise InputError(
                f"motor {motor.name!r} is listed twice; expected one entry per motor",
                file=str(path),
                row=row,
            )
        motors[motor.name] = motor
    if not motors:
        raise InputError("lists no motor; expected one entry per motor", file=str(path))
    return list(motors.values())


def _text(path: Path) -> str:
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise InputError("is not a regular file; expected a manifest", file=str(path))
        if path.stat().st_size > _LARGEST_BYTES:
            raise InputError(
                f"has {path.stat().st_size} bytes; expected a manifest of at most {_LARGEST_BYTES}",
                file=str(path),
            )
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UnreadableFile(
            f"cannot be opened ({error.strerror}); expected a manifest", file=str(path)
        ) from error
    except UnicodeDecodeError as error:
        raise InputError("is not text; expected a manifest", file=str(path)) from error


def _of_csv(text: str, path: Path, defaults: FitOptions) -> Iterator[tuple[int, Motor]]:
    try:
        lines = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise InputError("is not a CSV text file; expected a manifest", file=str(path)) from error
    header = [cell.strip() for cell in lines[0]] if lines else []
    known = (*_FIELDS, *_OPTIONS)
    wrong = set(header) - set(known) or len(set(header)) < len(header)
    if wrong or not {"motor", "training"} <= set(header):
        raise InputError(
            f"has the header {','.join(header)[:80]!r}; expected the columns motor,training and "
            f"optionally {','.join(known[2:])}",
            file=str(path),
            row=1,
        )
    for row, cells in enumerate(lines[1:], start=2):
        if not any(cell.strip() for cell in cells):
            continue
        place = Place(path, row)
        if len(cells) > len(header):
            raise place.wrong(f"has {len(cells)} cells; expected at most {len(header)}")
        entry: dict[str, Any] = dict.fromkeys(header, "") | {
            name: cell.strip() for name, cell in zip(header, cells, strict=False)
        }
        for role in _FILES:
            entry[role] = [f.strip() for f in entry.get(role, "").split(";") if f.strip()]
        options = {name: entry.pop(name) for name in _OPTIONS if name in entry}
        entry["options"] = {
            name: option_of(name, word, place.at(name)) for name, word in options.items() if word
        }
        yield row, _motor(entry, place, defaults)


def _of_yaml(text: str, path: Path, defaults: FitOptions) -> Iterator[tuple[int, Motor]]:
    try:
        content = yaml.load(text, _Loader)  # noqa: S506  subclass of the safe loader
    except (AttributeError, OverflowError, RecursionError, ValueError, yaml.YAMLError) as error:
        # YAML constructors pass on Python's own errors for malformed numbers and dates.
        mark = getattr(error, "problem_mark", None)
        raise InputError(
            f"is not YAML ({getattr(error, 'problem', None) or 'syntax error'}); expected a "
            "manifest",
            file=str(path),
            row=mark.line + 1 if mark else None,
        ) from error
    if not isinstance(content, Mapping) or not isinstance(content.get("motors"), Sequence):
        raise InputError(
            "has no list `motors`; expected a list with one entry per motor", file=str(path)
        )
    above = Place(path, None)
    above.only(content, ("motors", "options"))
    shared = options_with(defaults, _mapping(content.get("options"), above), above)
    for number, entry in enumerate(content["motors"], start=1):
        place = Place(path, None, f"motor {number} of the list")
        if not isinstance(entry, Mapping):
            raise place.wrong(f"is {str(entry)[:60]!r}; expected `motor` and `training`")
        place.only(entry, (*_FIELDS, "options"))
        listed = {role: _files(entry.get(role), role, place) for role in _FILES}
        options = _mapping(entry.get("options"), place)
        yield number, _motor({**entry, **listed, "options": options}, place, shared)


def _motor(entry: Mapping[str, Any], place: Place, defaults: FitOptions) -> Motor:
    name = str(entry.get("motor") or "")
    if not _NAME.fullmatch(name):
        raise place.at("motor").wrong(
            f"{name[:60]!r} is not a valid motor name; expected up to 100 of the characters A-Z "
            "a-z 0-9 _ . + -, with a letter, digit or _ first"
        )
    if name in _RESERVED:
        raise place.at("motor").wrong(
            f"{name!r} is the name of an output file of the batch; expected another motor name"
        )
    if place.entry:
        place = replace(place, entry=f"motor {name}")
    if not entry["training"]:
        raise place.at("training").wrong("has no training run; expected at least one")
    folder = place.path.parent
    training, validation = (
        tuple(run for file in entry[role] for run in _runs(folder, file, place.at(role)))
        for role in _FILES
    )
    mapping = entry.get("mapping")
    mapped = _path(folder, str(mapping), place.at("mapping")) if mapping else None
    options = options_with(defaults, entry["options"], place)
    bench, type_ = str(entry.get("bench") or ""), _type(entry.get("type"), place)
    try:
        Label(name, bench)
    except InputError as error:
        raise place.at("bench").wrong(error.message) from error
    return Motor(name, training, validation, options, mapped, bench, type_)


def _type(value: object, place: Place) -> str:
    if value is None:
        return ""
    is_text = isinstance(value, str | int) and not isinstance(value, bool)
    text = str(value).strip()
    if not is_text or len(text) > _LONGEST_TYPE or not text.isprintable():
        raise place.at("type").wrong(
            f"{ascii(value)[:60]} is not a valid motor type; expected up to {_LONGEST_TYPE} "
            "printable characters"
        )
    return text


def _path(folder: Path, file: str, place: Place) -> Path:
    """Path of a file named in the manifest; names with NUL or lone surrogates are rejected."""
    if "\0" in file or any("\ud800" <= letter <= "\udfff" for letter in file):
        raise place.wrong(f"{ascii(file)[:60]} is not a valid path; expected a file name")
    return folder / file


def _runs(folder: Path, file: str, place: Place) -> list[Path]:
    """Files that match a name with wildcards, in the order of the numbers in their names."""
    path = _path(folder, file, place)
    parts = file.split()
    if len(parts) > 1 and not lexists(path) and all(lexists(folder / part) for part in parts):
        raise place.wrong(
            f"{file[:60]!r} is no file; expected semicolons between the files of a run list"
        )
    # A file may have brackets in its name; a name that matches nothing fails with its motor.
    found = [] if not has_magic(file) or lexists(path) else glob(file, root_dir=folder)
    return [folder / name for name in sorted(found, key=_by_number)] or [path]


def unopened(error: OSError) -> str:
    """Reason why a file of the manifest cannot be read."""
    if isinstance(error, FileNotFoundError) and has_magic(str(error.filename)):
        return f"{error.filename}: no file matches this pattern; correct it in the manifest"
    return f"{error.filename}: cannot be opened ({error.strerror}); check path and permissions"


def _by_number(name: str) -> list[str | int]:
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


def _files(value: object, role: str, place: Place) -> list[str]:
    if value is None:
        return []
    if isinstance(value, str):
        return [value]
    if isinstance(value, Sequence) and all(isinstance(file, str) for file in value):
        return list(value)
    raise place.at(role).wrong(f"is {str(value)[:60]!r}; expected a list of run files")


def _mapping(value: object, place: Place) -> Mapping[str, Any]:
    if value is None:
        return {}
    if isinstance(value, Mapping):
        return value
    raise place.at("options").wrong(f"is {str(value)[:60]!r}; expected option names with values")


class _Loader(yaml.SafeLoader):
    """Loader that rejects aliases, very long scalars and duplicate keys with their line.

    Nested aliases in a few lines can expand beyond any memory.  A base-60 integer such as
    ``1:1:1`` takes a conversion time quadratic in its length.  Of two equal keys, PyYAML silently
    keeps the last.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose the next node; reject aliases and very long scalars."""
        event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise _fault("has an alias; expected each value written out", event)
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > _LONGEST_SCALAR:
            raise _fault(f"has a value of more than {_LONGEST_SCALAR} characters", event)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Construct a mapping; reject duplicate keys."""
        found = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                continue
            key = self.construct_object(key_node)
            if key in found:
                raise _fault(f"has the key {str(key)[:60]!r} twice; expected it once", key_node)
            found.add(key)
        return super().construct_mapping(node, deep)


def _fault(problem: str, place: yaml.Event | yaml.Node) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(None, None, problem, place.start_mark)  # type: ignore[arg-type]
