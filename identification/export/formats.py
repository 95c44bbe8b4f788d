"""Formats of an export, by name; CSV is a table of parameters, effects and feedback metrics."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Literal

from identification.arrays import Array
from identification.errors import OptionError
from identification.export.c_code import c_code
from identification.export.fmu import fmu
from identification.export.language import MATLAB, MODELICA, PYTHON, Language
from identification.export.model import Exported, entries_of, exported_model
from identification.export.scripts import continuous_notes, linear_motors, script
from identification.fleet.table import csv_cell
from identification.speed_loop.metrics import METRIC_UNITS
from identification.speed_loop.spread import checked_temperatures

__all__ = ["Export", "ExportFormat", "FORMATS", "csv_table", "export"]

Draws = Mapping[str, Array]
_COLUMNS: Final = (
    "group", "name", "temperature_degC", "controller", "mean", "sd", "q05", "median", "q95", "unit",
    "identified",
)  # fmt: skip

_GROUPS: Final = ("feedback", "feedback_nonlinear")


@dataclass(frozen=True)
class Request:
    """Input of a format."""

    result: Mapping[str, Any]
    """Content of a result.json."""
    draws: Draws
    """(n_draw,) for each nominal parameter; empty if the format holds no samples."""
    temperatures: Sequence[float]
    """Temperatures of linear models [degC]."""
    sampled: tuple[str, ...] = ()
    """Remark about the draws, if there is one."""

    @cached_property
    def motor(self) -> Exported:
        """The final model."""
        return exported_model(self.result)

    @property
    def header(self) -> list[str]:
        """Effects of the model, what the export does not hold, and the kind of the samples."""
        kept = [term.name for term in self.motor.model.terms[:-1]]
        notes = [f"Not in this file: {note}." for note in self.motor.notes]
        return [f"Effects in the model: {', '.join(kept) or 'none'}.", *notes, *self.sampled]


@dataclass(frozen=True)
class Export:
    """Content of an exported file."""

    content: bytes
    remarks: tuple[str, ...] = ()
    """What the export does not hold, as sentences."""


Writer = Callable[[Request], Export]


@dataclass(frozen=True)
class ExportFormat:
    """One format."""

    write: Writer
    is_linear: bool = False
    """True if the file holds linear models at temperatures, with samples of the parameters."""


def export(
    result: Mapping[str, Any],
    form: str,
    draws: Callable[[], tuple[Draws, str]],
    temperatures: Sequence[float] = (),
) -> Export:
    """A result in the format of another program.

    Args:
        result: Content of a result.json.
        form: Name of the format.
        draws: Function that returns (n_draw,) for each nominal parameter, and a remark about them
            or an empty text; called if the file holds samples.
        temperatures: Temperatures of linear models; default: those of the feedback metrics [degC].

    Raises:
        OptionError: The format or a temperature is not accepted, or temperatures are given for a
            format without linear models.
        InputError: A parameter or effect is missing or unknown.
    """
    if form not in FORMATS:
        raise OptionError(
            f"export format {form!r} is not known; expected {', '.join(FORMATS)}", value=form
        )
    found = [entry.get("temperature_degC") for entry in entries_of(result.get("feedback"))]
    usual = sorted({float(value) for value in found if isinstance(value, int | float)})
    chosen = checked_temperatures(temperatures or usual or [25.0, 125.0])
    if temperatures and not FORMATS[form].is_linear:
        linear = ", ".join(name for name, one in FORMATS.items() if one.is_linear)
        raise OptionError(
            f"temperatures are given, and the format {form} has no linear models; "
            f"leave --temperature out, or choose {linear}",
            value=list(temperatures),
        )
    samples, remark = draws() if FORMATS[form].is_linear else ({}, "")
    sampled = (remark,) if remark else ()
    made = FORMATS[form].write(Request(result, samples, chosen, sampled))
    return Export(made.content, (*sampled, *made.remarks))


def _fmu(request: Request, fmi: Literal[2, 3]) -> Export:
    content, remarks = fmu(request.motor, request.header, fmi)
    return Export(content, (*request.motor.notes, *remarks))


def _equations(template: str, language: Language, *, is_linear: bool = False) -> ExportFormat:
    """Format with the continuous equations: with the linear motor, else with channel delays."""

    def write(request: Request) -> Export:
        notes = tuple(continuous_notes(request.motor, delays=not is_linear))
        header = [*request.header, *(f"Not in this file: {note}." for note in notes)]
        numbers = (
            linear_motors(request.result, request.draws, request.temperatures) if is_linear else []
        )
        text = script(template, request.motor, language, header, numbers)
        return Export(text.encode(), (*request.motor.notes, *notes))

    return ExportFormat(write, is_linear)


FORMATS: Final[Mapping[str, ExportFormat]] = {
    "python-control": _equations("python_control.py.txt", PYTHON, is_linear=True),
    "matlab": _equations("matlab.m.txt", MATLAB, is_linear=True),
    "simulink-m": _equations("simulink.m.txt", MATLAB),
    "modelica": _equations("modelica.mo.txt", MODELICA),
    "fmu": ExportFormat(lambda request: _fmu(request, 2)),
    "fmu3": ExportFormat(lambda request: _fmu(request, 3)),
    "c": ExportFormat(lambda r: Export(c_code(r.motor, r.header).encode(), r.motor.notes)),
    "csv": ExportFormat(lambda request: Export(csv_table(request.result).encode())),
}
"""Formats by the name in ``--to``."""


def csv_table(result: Mapping[str, Any]) -> str:
    """Table with one row per parameter and per metric; unknown numbers are empty cells."""
    text = io.StringIO()
    writer = csv.DictWriter(text, _COLUMNS, restval="", lineterminator="\n")
    writer.writeheader()
    for row in _rows(result):
        writer.writerow({name: csv_cell(row.get(name)) for name in _COLUMNS})
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
