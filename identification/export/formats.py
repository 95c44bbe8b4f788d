"""Formats of an export, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from identification.errors import OptionError
from identification.export.c_code import c_code
from identification.export.fmu import fmu
from identification.export.language import MATLAB, MODELICA, PYTHON, Language
from identification.export.model import Exported, exported_model
from identification.export.scripts import continuous_notes, linear_motors, script
from identification.export.table import csv_table
from identification.feedback.spread import checked_temperatures

__all__ = ["FORMATS", "Export", "ExportFormat", "export"]

Draws = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Request:
    """What a format writes.

    Args:
        result: Content of a result.json.
        motor: The final model.
        draws: (n_draw,) for each nominal parameter; empty if the format holds no samples.
        temperatures: Temperatures of linear models [degC].
        header: Lines about the motor for the top of a file.
    """

    result: Mapping[str, Any]
    motor: Exported
    draws: Draws
    temperatures: Sequence[float]
    header: list[str]


@dataclass(frozen=True)
class Export:
    """Content of an exported file.

    Args:
        content: The bytes.
        remarks: What the export does not hold, as sentences.
    """

    content: bytes
    remarks: tuple[str, ...] = ()


Writer = Callable[[Request], Export]


@dataclass(frozen=True)
class ExportFormat:
    """One format.

    Args:
        suffix: Suffix of its files.
        media_type: Media type over HTTP.
        write: Function that makes the file.
        is_sampled: Whether the file holds samples of the parameters.
    """

    suffix: str
    media_type: str
    write: Writer
    is_sampled: bool = False


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
        OptionError: The format or a temperature is not accepted.
        InputError: A parameter or effect is missing or unknown.
    """
    if form not in FORMATS:
        raise OptionError(
            f"export format {form!r} is not known; expected {', '.join(FORMATS)}", value=form
        )
    chosen = checked_temperatures(temperatures or _usual_temperatures(result))
    motor = exported_model(result)
    samples, remark = draws() if FORMATS[form].is_sampled else ({}, "")
    sampled = [remark] if remark else []
    header = _header(motor, sampled)
    made = FORMATS[form].write(Request(result, motor, samples, chosen, header))
    return Export(made.content, (*sampled, *motor.notes, *made.remarks))


def _usual_temperatures(result: Mapping[str, Any]) -> list[float]:
    entries = result.get("feedback")
    found = [
        entry.get("temperature_degC")
        for entry in (entries if isinstance(entries, list) else [])
        if isinstance(entry, Mapping)
    ]
    known = sorted({float(value) for value in found if isinstance(value, int | float)})
    return known or [25.0, 125.0]


def _header(motor: Exported, sampled: list[str]) -> list[str]:
    """Effects of the model, what the export does not hold of them, and the kind of the samples."""
    kept = [term.name for term in motor.model.terms[:-1]]
    lines = [f"Effects in the model: {', '.join(kept)}." if kept else "Effects in the model: none."]
    return lines + [f"Not in this file: {note}." for note in motor.notes] + sampled


def _c(request: Request) -> Export:
    return Export(c_code(request.motor, request.header).encode())


def _fmu(request: Request, fmi: Literal[2, 3]) -> Export:
    return Export(*fmu(request.motor, request.header, fmi))


def _equations(template: str, language: Language, *, delays: bool, linear: bool) -> Writer:
    """Writer of a format with the continuous equations.

    Args:
        template: Name of its template.
        language: Its language.
        delays: Whether it holds delays of channels.
        linear: Whether it holds the linear motor with samples.
    """

    def write(request: Request) -> Export:
        notes = continuous_notes(request.motor, delays=delays)
        header = [*request.header, *(f"Not in this file: {note}." for note in notes)]
        numbers = (
            linear_motors(request.result, request.draws, request.temperatures) if linear else []
        )
        return Export(script(template, request.motor, language, header, numbers).encode(), notes)

    return write


_python = _equations("python_control.py.txt", PYTHON, delays=False, linear=True)
_matlab = _equations("matlab.m.txt", MATLAB, delays=False, linear=True)
_simulink = _equations("simulink.m.txt", MATLAB, delays=True, linear=False)
_modelica = _equations("modelica.mo.txt", MODELICA, delays=True, linear=False)


def _csv(request: Request) -> Export:
    return Export(csv_table(request.result).encode())


FORMATS: Final[Mapping[str, ExportFormat]] = {
    "python-control": ExportFormat(".py", "text/x-python", _python, is_sampled=True),
    "matlab": ExportFormat(".m", "text/x-matlab", _matlab, is_sampled=True),
    "simulink-m": ExportFormat(".m", "text/x-matlab", _simulink),
    "modelica": ExportFormat(".mo", "text/x-modelica", _modelica),
    "fmu": ExportFormat(".fmu", "application/zip", lambda request: _fmu(request, 2)),
    "fmu3": ExportFormat(".fmu", "application/zip", lambda request: _fmu(request, 3)),
    "c": ExportFormat(".c", "text/x-c", _c),
    "csv": ExportFormat(".csv", "text/csv", _csv),
}
"""Formats by the name in ``--to``."""
