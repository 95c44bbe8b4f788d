"""Entries of result.json from posterior draws (PARAMETER, QUANTITY), and writing of the file.

    {"mean", "sd", "q05", "median", "q95", "unit"}            QUANTITY
    {"mean", "sd", "q05", "median", "q95", "unit", "identified"}   PARAMETER

JSON has neither NaN nor infinity, so an unknown number is null.  The interval from q05 to q95 is
the equal-tailed 90 % interval.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from identification.known import KNOWN
from identification.nameplate import NAMEPLATE
from identification.result.atomic import write_text

__all__ = [
    "Entry",
    "INTERVAL_KIND",
    "INTERVAL_LEVEL",
    "NEAR_NOISE",
    "NOTHING",
    "ORIGINS",
    "SCHEMA_VERSION",
    "finite_or_null",
    "known_only_from",
    "parameter_entry",
    "quantity_entry",
    "result_text",
    "write_result",
]

Entry = Mapping[str, Any]
"""An object of result.json."""
SCHEMA_VERSION: Final = 1
INTERVAL_KIND: Final = "equal-tailed"
INTERVAL_LEVEL: Final = 0.90
NEAR_NOISE: Final = 1.10
"""Noise ratio (simulation error over sensor noise) above which the model is incomplete [-]."""
NOTHING: Final = 0.9
"""NRMSE above which a model explains nothing of a channel [-]."""

_STATISTICS: Final = ("mean", "sd", "q05", "median", "q95")
_QUANTILES: Final = (0.05, 0.5, 0.95)


def finite_or_null(value: object) -> Any:
    """Plain Python types of nested arrays and scalars, None for numbers that are not finite."""
    if isinstance(value, Mapping):
        return {str(key): finite_or_null(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return finite_or_null(value.tolist())
    if isinstance(value, list | tuple):
        return [finite_or_null(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def quantity_entry(draws: ArrayLike, unit: str) -> dict[str, Any]:
    """QUANTITY from draws (n_draw,) in `unit`; NaN or infinity where undefined.

    A metric can be undefined for some draws: an unstable loop has no settling time.  The statistics
    then cover the draws for which it is defined, and ``defined_fraction`` is the fraction of these
    draws.  If no draw defines the metric, all statistics are null.
    """
    values = np.asarray(draws, dtype=np.float64).ravel()
    finite = values[np.isfinite(values)]
    numbers: list[float | None] = [None] * len(_STATISTICS)
    if finite.size:
        numbers = finite_or_null([finite.mean(), finite.std(), *np.quantile(finite, _QUANTILES)])
    entry = dict(zip(_STATISTICS, numbers, strict=True)) | {"unit": unit}
    if finite.size < values.size:
        entry["defined_fraction"] = finite.size / values.size
    return entry


def parameter_entry(draws: ArrayLike, unit: str, identified: bool) -> dict[str, Any]:
    """PARAMETER from posterior draws (n_draw,) in `unit`, as the contract spells it."""
    return quantity_entry(draws, unit) | {"identified": bool(identified)}


ORIGINS: Final = {KNOWN: f"{KNOWN} (known values)", NAMEPLATE: f"{NAMEPLATE} (nameplate)"}
"""Origins of known values, with the field of the service's form."""


def known_only_from(entry: Mapping[str, Any]) -> str:
    """Origin of the known value that alone identifies a PARAMETER; empty if there is none."""
    prior = entry.get("prior") or {}
    if not (entry.get("identified") and prior.get("used")) or prior.get("identified_by_runs"):
        return ""
    origin = str(prior.get("origin", ""))
    return ORIGINS.get(origin, origin)


def result_text(result: Mapping[str, Any]) -> str:
    """Result as JSON text; numbers keep their full precision, keys keep their order."""
    return json.dumps(finite_or_null(result), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_result(path: Path, result: Mapping[str, Any]) -> None:
    """Write result.json to `path` atomically."""
    write_text(path, result_text(result))
