"""Tables of a result as DataFrames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Final, Literal

import pandas as pd

from identification.errors import InputError, OptionError
from identification.ingest.display import plain
from identification.result.entries import Entry
from identification.speed_loop import METRIC_UNITS

__all__ = ["TableName", "as_written", "feedback_table", "result_table"]

_SPREAD: Final = ("median", "q05", "q95", "mean", "sd", "unit")

TableName = Literal["parameters", "declared", "effects", "errors", "feedback", "warnings"]
"""``parameters`` of the final model and its effects, those of the nominal model (``declared``),
``effects``, simulation ``errors``, ``feedback`` metrics, ``warnings``."""


def result_table(result: Entry, name: TableName) -> pd.DataFrame:
    """One table of a result; its columns have the names of the members of result.json.

    Raises:
        OptionError: There is no table of this name.
        InputError: The result was edited, and the table is not found in it.
    """
    if name not in _TABLES:
        raise OptionError(
            f"there is no table {name!r}; expected one of {', '.join(_TABLES)}", value=name
        )
    with as_written(name):
        return _TABLES[name](result)


def feedback_table(entries: Sequence[Entry]) -> pd.DataFrame:
    """Table of the list under ``feedback`` of a result, a row for each metric."""
    rows = [
        [entry["controller"], entry["temperature_degC"], metric]
        + [entry[metric].get(name) for name in _SPREAD]
        for entry in entries
        for metric in METRIC_UNITS
        if entry.get(metric) is not None
    ]
    return pd.DataFrame(rows, columns=["controller", "temperature_degC", "metric", *_SPREAD])


@contextmanager
def as_written(member: str) -> Iterator[None]:
    """Turn the faults of members that were edited or cut into an error.

    Raises:
        InputError: The members do not have the form in which motorid writes them.
    """
    try:
        yield
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        reason = plain(" ".join(f"{type(error).__name__}: {error}".split()), 120)
        raise InputError(
            f"the {member} of the result are not as 'motorid fit' writes them ({reason}); use the "
            "unchanged result.json, or repeat the fit"
        ) from error


def _parameters(entries: Mapping[str, Entry]) -> pd.DataFrame:
    columns = [*_SPREAD, "identified"]
    rows = [[entry.get(column) for column in columns] for entry in entries.values()]
    return pd.DataFrame(rows, pd.Index(list(entries), name="parameter"), columns)


def _final(result: Entry) -> pd.DataFrame:
    effects = {
        f"{effect['name']}.{name}": entry
        for effect in result["effects"]
        for name, entry in effect["parameters"].items()
        if name not in result["parameters"]
    }
    return _parameters({**result["parameters"], **effects})


def _effects(result: Entry) -> pd.DataFrame:
    rows = [
        [effect["name"], effect["equation"], ", ".join(effect["drivers"]), effect["probability"]]
        for effect in result["effects"]
    ]
    return pd.DataFrame(rows, columns=["name", "equation", "drivers", "probability"])


def _errors(result: Entry) -> pd.DataFrame:
    measures = ["rmse", "nrmse", "noise_ratio"]
    rows = [
        [stage, role, channel, *(error.get(measure) for measure in measures)]
        for stage, roles in result["errors"].items()
        for role, channels in roles.items()
        for channel, error in (channels or {}).items()
        if error is not None
    ]
    return pd.DataFrame(rows, columns=["model", "role", "channel", *measures])


def _warnings(result: Entry) -> pd.DataFrame:
    details = result.get("warning_details") or [{}] * len(result["warnings"])
    rows = [
        [detail.get("severity", ""), detail.get("code", ""), message, detail.get("fix", "")]
        for message, detail in zip(result["warnings"], details, strict=True)
    ]
    return pd.DataFrame(rows, columns=["severity", "code", "message", "fix"])


_TABLES: dict[str, Callable[[Entry], pd.DataFrame]] = {
    "parameters": _final,
    "declared": lambda result: _parameters(result["declared"]["parameters"]),
    "effects": _effects,
    "errors": _errors,
    "feedback": lambda result: feedback_table(result["feedback"]),
    "warnings": _warnings,
}
