"""Identification of a brushed DC motor from measured runs.

    from identification import identify, read_run

    identification = identify([read_run("run1.csv"), read_run("run2.csv")])
    identification.result["parameters"]["Ra25"]["median"]

Names are imported when they are first used, so that a program that only reads a file does not
import the simulation.
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
    from identification.ingest import Run, read_run
    from identification.options import FitOptions
    from identification.pipeline import Identification, identify
    from identification.prediction import Prediction, predict

__all__ = [
    "ComputationError",
    "FitOptions",
    "Identification",
    "IdentificationError",
    "InputError",
    "OptionError",
    "Prediction",
    "Run",
    "RunFileError",
    "identify",
    "predict",
    "read_run",
]

_HOMES = {
    "FitOptions": "options",
    "Identification": "pipeline",
    "Prediction": "prediction",
    "Run": "ingest",
    "identify": "pipeline",
    "predict": "prediction",
    "read_run": "ingest",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES.get(name, 'errors')}"), name)


def __dir__() -> list[str]:
    return __all__
