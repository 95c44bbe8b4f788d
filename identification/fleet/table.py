"""Results table of a batch: one row per motor, as CSV, JSON or Parquet.

NAME                        median of the parameter, in its unit
NAME_sd, NAME_q05, NAME_q95 its standard deviation and 90 % interval
NAME_identified             whether the data identify it
NAME_drift                  median minus that of the previous refit
NAME_drift_relative         drift over the magnitude of the previous median
NAME_drift_sds              drift over the combined standard deviation
NAME_drift_probability      p-value of the drift, adjusted over the whole table
NAME_drift_significant      whether the adjusted p-value is at most 0.05
drift_cause                 most probable cause of the change of the motor
NAME_pooled, NAME_pooled_q05, NAME_pooled_q95
                            median and 90 % interval with the other motors of the type, only for
                            the temperature coefficients

`identification.fleet.drift` and `identification.fleet.pooling` describe the statistics.

A second table has a row per motor and pooled quantity, effect sizes included.  An
unknown cell is empty or null.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from identification.errors import InputError
from identification.fleet.drift import Drift, drifts
from identification.fleet.explanation import Explanation, explanations
from identification.fleet.pooling import POOLED_PARAMETERS, Pool, pools_of
from identification.fleet.refit import Estimate, Refit
from identification.quantities import DECLARED_PARAMETERS

__all__ = [
    "COLUMNS",
    "POOLED_COLUMNS",
    "MissingParquet",
    "csv_text",
    "parquet_bytes",
    "pooled_rows",
    "rows_of",
]

Row = dict[str, Any]

# CSV readers disagree on whether a lone carriage return ends a line.
_CONTROL = re.compile(r"[\x00-\x1f\x7f]+")

# A formula begins at the start of a cell or after a separator at which some spreadsheets split.
# Spreadsheets in Japanese or Chinese locales also accept the full-width forms of = + - @.
_FORMULA = re.compile(r"(^|[;,])(?=\s*[=+\-@\uff1d\uff0b\uff0d\uff20])")

# Column suffix: cell type, and whether the column has the unit of the parameter.
_OF_PARAMETER: dict[str, tuple[type, bool]] = {
    "": (float, True),
    "_sd": (float, True),
    "_q05": (float, True),
    "_q95": (float, True),
    "_identified": (bool, False),
    "_drift": (float, True),
    "_drift_relative": (float, False),
    "_drift_sds": (float, False),
    "_drift_probability": (float, False),
    "_drift_significant": (bool, False),
}
_QUANTILES = ("q05", "median", "q95")
_RATIOS = {
    f"{role}_noise_ratio_{channel}": (role, channel)
    for role in ("training", "validation")
    for channel in ("current", "speed")
}

COLUMNS: dict[str, tuple[type, str]] = {
    "motor": (str, ""),
    "type": (str, ""),
    "status": (str, ""),
    **{
        f"{parameter.name}{ending}": (kind, parameter.unit if has_unit else "")
        for parameter in DECLARED_PARAMETERS.values()
        for ending, (kind, has_unit) in _OF_PARAMETER.items()
    },
    **{
        f"{name}_pooled{ending}": (float, DECLARED_PARAMETERS[name].unit)
        for name in POOLED_PARAMETERS
        for ending in ("", "_q05", "_q95")
    },
    "drift_probability": (float, ""),
    "drift_significant": (bool, ""),
    "drift_cause": (str, ""),
    "drift_cause_probability": (float, ""),
    "drift_causes": (str, ""),
    "drift_compared": (str, ""),
    "effects": (str, ""),
    **dict.fromkeys(_RATIOS, (float, "")),
    "fit": (str, ""),
    "ended_at": (str, ""),
    "previous_fit": (str, ""),
    "previous_ended_at": (str, ""),
    "previous_effects": (str, ""),
    "previous_shared_runs": (int, ""),
    "error": (str, ""),
    "warnings": (int, ""),
    "first_warning": (str, ""),
}
"""Columns in order, each with its cell type and unit."""

POOLED_COLUMNS = (
    "type", "parameter", "unit", "motor",
    *_QUANTILES, "identified", "left_out", *(f"pooled_{level}" for level in _QUANTILES),
    "type_motors", *(f"type_mean_{level}" for level in _QUANTILES),
    "type_spread_is_relative", *(f"type_spread_{level}" for level in _QUANTILES),
)  # fmt: skip
"""Columns of the table of pooled quantities, in order."""


class MissingParquet(InputError):
    """Parquet was requested, but pyarrow is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "Parquet requires pyarrow, which is not installed; install it with pip install "
            "'motorid[parquet]', or use the CSV table"
        )


def rows_of(refits: Sequence[Refit]) -> list[Row]:
    """Table rows with the columns of `COLUMNS`.

    The refits are all motors of the table, because p-values are adjusted over all of them.
    """
    rows = [
        _row(refit, changes, explanation)
        for refit, changes, explanation in zip(
            refits, drifts(refits), explanations(refits), strict=True
        )
    ]
    for pool in pools_of(refits):
        if pool.name in POOLED_PARAMETERS:
            for number, (low, median, high) in pool.motors.items():
                found = {"": median, "_q05": low, "_q95": high}
                rows[number] |= {f"{pool.name}_pooled{end}": v for end, v in found.items()}
    return rows


def pooled_rows(refits: Sequence[Refit]) -> list[Row]:
    """Rows with the columns of `POOLED_COLUMNS`: each motor of each pooled quantity."""
    return [
        _pooled_row(pool, number, refits[number].motor)
        for pool in pools_of(refits)
        for number in pool.own
    ]


def csv_text(rows: Sequence[Mapping[str, Any]], columns: Iterable[str] = COLUMNS) -> str:
    """Table as CSV, numbers in full precision, protected against formula injection."""
    table = io.StringIO()
    writer = csv.DictWriter(table, list(columns), lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    return table.getvalue()


def parquet_bytes(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Table as the content of a Parquet file; units are metadata of the columns.

    Raises:
        MissingParquet: pyarrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise MissingParquet from error
    kinds = {
        str: pyarrow.string(),
        float: pyarrow.float64(),
        bool: pyarrow.bool_(),
        int: pyarrow.int64(),
    }
    fields = [
        pyarrow.field(name, kinds[kind], metadata={"unit": unit} if unit else None)
        for name, (kind, unit) in COLUMNS.items()
    ]
    table = pyarrow.Table.from_pylist([dict(row) for row in rows], schema=pyarrow.schema(fields))
    content = io.BytesIO()
    parquet.write_table(table, content)
    return content.getvalue()


def _row(refit: Refit, changes: Mapping[str, Drift], explanation: Explanation | None) -> Row:
    before = refit.previous
    row: Row = {"motor": refit.motor, "type": refit.type or None, "status": refit.status}
    for name in DECLARED_PARAMETERS:
        row |= _parameter(name, refit.estimates.get(name), changes.get(name))
    pooled = [f"{name}_pooled{end}" for name in POOLED_PARAMETERS for end in ("", "_q05", "_q95")]
    row |= dict.fromkeys(pooled)
    row |= _explained(explanation)
    return row | {
        "effects": " ".join(refit.effects),
        **{column: refit.noise_ratios.get(key) for column, key in _RATIOS.items()},
        "fit": refit.fit or None,
        "ended_at": refit.ended_at,
        "previous_fit": before.fit if before else None,
        "previous_ended_at": before.ended_at if before else None,
        "previous_effects": " ".join(before.effects) if before else None,
        "previous_shared_runs": len({*refit.training} & {*before.training}) if before else None,
        "error": refit.error or None,
        "warnings": len(refit.warnings) if refit.estimates else None,
        "first_warning": refit.warnings[0] if refit.warnings else None,
    }


def _parameter(name: str, estimate: Estimate | None, drift: Drift | None) -> Row:
    return {
        name: estimate and estimate.median,
        f"{name}_sd": estimate and estimate.sd,
        f"{name}_q05": estimate and estimate.q05,
        f"{name}_q95": estimate and estimate.q95,
        f"{name}_identified": estimate and estimate.is_identified,
        f"{name}_drift": drift and drift.absolute,
        f"{name}_drift_relative": drift and drift.relative,
        f"{name}_drift_sds": drift and drift.sds,
        f"{name}_drift_probability": drift and drift.probability,
        f"{name}_drift_significant": drift and drift.is_significant,
    }


def _explained(explanation: Explanation | None) -> Row:
    if explanation is None:
        explanation = Explanation((), None)
    likely = explanation.likely
    return {
        "drift_probability": explanation.probability,
        "drift_significant": explanation.is_significant,
        "drift_cause": explanation.cause or None,
        "drift_cause_probability": explanation.causes.get(explanation.cause) if likely else None,
        "drift_causes": " ".join(f"{name}:{p:.2f}" for name, p in likely.items()) or None,
        "drift_compared": " ".join(explanation.compared) or None,
    }


def _pooled_row(pool: Pool, number: int, motor: str) -> Row:
    own = pool.own[number]
    pooled = pool.motors.get(number, (None, None, None))
    return {
        "type": pool.type or None,
        "parameter": pool.name,
        "unit": pool.unit,
        "motor": motor,
        "q05": own.q05,
        "median": own.median,
        "q95": own.q95,
        "identified": own.is_identified,
        "left_out": number in pool.left_out,
        **_levels("pooled", pooled),
        "type_motors": pool.count,
        **_levels("type_mean", pool.mean),
        "type_spread_is_relative": pool.is_relative,
        **_levels("type_spread", pool.spread),
    }


def _levels(name: str, quantiles: Sequence[float | None]) -> Row:
    return {f"{name}_{level}": v for level, v in zip(_QUANTILES, quantiles, strict=True)}


def _cell(value: object) -> object:
    """CSV cell; an apostrophe precedes any text that a spreadsheet would read as a formula.

    Source:
        OWASP, "CSV Injection": the signs, their full-width forms, and separators within a cell.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _FORMULA.sub(r"\1'", _CONTROL.sub(" ", value))
    return value
