"""Identification of a brushed DC motor from measured runs.

    import identification as mi

    mi.check(["cold.csv", "hot.csv"])                  what was understood, what can be identified
    found = mi.identify(["cold.csv", "hot.csv"], validation="check.csv")
    found.table()                                      parameters with intervals, a DataFrame
    found.write("out/motor")                           result.json, report.html, posterior.nc
    mi.predict(found, "other.csv")                     current and speed, a DataFrame
    mi.feedback(found, controllers="PI:2,0.5")         speed loop cold and hot, a DataFrame

A run is the path of a file, a DataFrame, or what `read_run` returns; one or a list of them.  Names
are imported when they are first used, so that a program that only reads a file does not import the
simulation.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identification.errors import (
        ComputationError,
        IdentificationError,
        InputError,
        OptionError,
        RunFileError,
    )
    from identification.identified import (
        Identified,
        MissingPackage,
        StoredResult,
        feedback,
        inference_data,
        read_result,
    )
    from identification.ingest import Run, read_run, write_run
    from identification.options import FitOptions
    from identification.pipeline import Identification, identify
    from identification.prediction import predict
    from identification.preview import Preview, check
    from identification.reporting.files import report

__all__ = [
    "ComputationError",
    "FitOptions",
    "Identification",
    "IdentificationError",
    "Identified",
    "InputError",
    "MissingPackage",
    "OptionError",
    "Preview",
    "Run",
    "RunFileError",
    "StoredResult",
    "check",
    "feedback",
    "identify",
    "inference_data",
    "predict",
    "read_result",
    "read_run",
    "report",
    "write_run",
]

_HOMES = {
    "FitOptions": "options",
    "Identification": "pipeline",
    "Identified": "identified",
    "MissingPackage": "identified",
    "Preview": "preview",
    "Run": "ingest",
    "StoredResult": "identified",
    "check": "preview",
    "feedback": "identified",
    "identify": "pipeline",
    "inference_data": "identified",
    "predict": "prediction",
    "read_result": "identified",
    "read_run": "ingest",
    "report": "reporting.files",
    "write_run": "ingest",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES.get(name, 'errors')}"), name)


def __dir__() -> list[str]:
    return __all__
