"""CSV table of a result: parameters, parameters of effects, and feedback metrics."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from identification.speed_loop.metrics import METRIC_UNITS

__all__ = ["COLUMNS", "csv_table", "entries_of"]

COLUMNS: Final = (
    "group", "name", "temperature_degC", "controller", "mean", "sd", "q05", "median", "q95", "unit",
    "identified",
)  # fmt: skip

_GROUPS: Final = ("feedback", "feedback_nonlinear")


def csv_table(result: Mapping[str, Any]) -> str:
    """Table with one row per parameter and per metric; unknown numbers are empty cells."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n")
    writer.writeheader()
    for row in _rows(result):
        writer.writerow({name: _cell(row.get(name)) for name in COLUMNS})
    return text.getvalue()


def _rows(result: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for name, entry in _members(result.get("parameters")):
        yield {**entry, "group": "parameters", "name": name}
    for effect in entries_of(result.get("effects")):
        for name, entry in _members(effect.get("parameters")):
            yield {**entry, "group": "effects", "name": f"{effect.get('name')}.{name}"}
    for group in _GROUPS:
        for loop in entries_of(result.get(group)):
            place = {name: loop.get(name) for name in ("temperature_degC", "controller")}
            for name, entry in _members({name: loop.get(name) for name in METRIC_UNITS}):
                yield {**entry, **place, "group": group, "name": name}


def _members(found: object) -> Sequence[tuple[str, Mapping[str, Any]]]:
    members = found.items() if isinstance(found, Mapping) else ()
    return [(str(name), entry) for name, entry in members if isinstance(entry, Mapping)]


def entries_of(found: object) -> list[Mapping[str, Any]]:
    """Objects in a list of a result; none if a member is something else."""
    return [one for one in found if isinstance(one, Mapping)] if isinstance(found, list) else []


def _cell(value: object) -> object:
    """Cell of the table; a text that a spreadsheet would evaluate is marked as text."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    # A sign alone, such as the unit of a ratio, is no formula.
    is_formula = isinstance(value, str) and len(value) > 1 and value[0] in "=+-@\t\r"
    return f"'{value}" if is_formula else value
