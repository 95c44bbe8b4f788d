"""Results table of a batch: one row per motor, as CSV, JSON or Parquet.

docs/batch.md explains the columns, `identification.fleet.drift` and `identification.fleet.pooling`
the statistics.  A second table has a row per motor and pooled quantity, effect sizes included.  An
unknown cell is empty or null.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from identification.errors import InputError
from identification.fleet.drift import Drift, drifts
from identification.fleet.explanation import Explanation, explanations
from identification.fleet.pooling import POOLED_PARAMETERS, Pool, Quantiles, pools_of
from identification.fleet.refit import Refit
from identification.quantities import DECLARED_PARAMETERS

__all__ = [
    "COLUMNS",
    "POOLED_COLUMNS",
    "MissingParquet",
    "csv_cell",
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
# A sign alone, such as the unit of a ratio, is none.
_FORMULA = re.compile(r"(^|[;,])(?=\s*[=+\-@\uff1d\uff0b\uff0d\uff20]\s*[^\s;,])")

_QUANTILES = ("q05", "median", "q95")


class _Motor(NamedTuple):
    """Content of a row: a motor, its changes since the last refit, and pooled quantiles."""

    refit: Refit
    before: Refit | None
    changes: Mapping[str, Drift]
    change: Explanation
    pooled: dict[str, Quantiles]


_Cell = Callable[[_Motor], Any]


def _estimated(name: str, member: str) -> _Cell:
    return lambda motor: getattr(motor.refit.estimates.get(name), member, None)


def _drifted(name: str, member: str) -> _Cell:
    return lambda motor: getattr(motor.changes.get(name), member, None)


def _pooled(name: str, level: int) -> _Cell:
    return lambda motor: motor.pooled[name][level] if name in motor.pooled else None


def _ratio(role: str, channel: str) -> _Cell:
    return lambda motor: motor.refit.noise_ratios.get((role, channel))


def _words(likely: Mapping[str, float]) -> str:
    return " ".join(f"{name}:{probability:.2f}" for name, probability in likely.items())


# Column suffix: cell type, whether the column has the unit of the parameter, and its cell.
_OF_PARAMETER: dict[str, tuple[type, bool, Callable[[str, str], _Cell], str]] = {
    "": (float, True, _estimated, "median"),
    "_sd": (float, True, _estimated, "sd"),
    "_q05": (float, True, _estimated, "q05"),
    "_q95": (float, True, _estimated, "q95"),
    "_identified": (bool, False, _estimated, "is_identified"),
    "_drift": (float, True, _drifted, "absolute"),
    "_drift_relative": (float, False, _drifted, "relative"),
    "_drift_sds": (float, False, _drifted, "sds"),
    "_drift_probability": (float, False, _drifted, "probability"),
    "_drift_significant": (bool, False, _drifted, "is_significant"),
}
_TABLE: dict[str, tuple[type, str, _Cell]] = {
    "motor": (str, "", lambda motor: motor.refit.motor),
    "type": (str, "", lambda motor: motor.refit.type or None),
    "status": (str, "", lambda motor: motor.refit.status),
    **{
        f"{one.name}{ending}": (kind, one.unit if has_unit else "", cell(one.name, member))
        for one in DECLARED_PARAMETERS.values()
        for ending, (kind, has_unit, cell, member) in _OF_PARAMETER.items()
    },
    **{
        f"{name}_pooled{ending}": (float, DECLARED_PARAMETERS[name].unit, _pooled(name, level))
        for name in POOLED_PARAMETERS
        for level, ending in ((1, ""), (0, "_q05"), (2, "_q95"))
    },
    "drift_probability": (float, "", lambda motor: motor.change.probability),
    "drift_significant": (bool, "", lambda motor: motor.change.is_significant),
    "drift_cause": (str, "", lambda motor: motor.change.cause or None),
    "drift_cause_probability": (
        float, "", lambda motor: motor.change.likely.get(motor.change.cause)
    ),
    "drift_causes": (str, "", lambda motor: _words(motor.change.likely) or None),
    "drift_compared": (str, "", lambda motor: " ".join(motor.change.compared) or None),
    "effects": (str, "", lambda motor: " ".join(motor.refit.effects)),
    **{
        f"{role}_noise_ratio_{channel}": (float, "", _ratio(role, channel))
        for role in ("training", "validation")
        for channel in ("current", "speed")
    },
    "fit": (str, "", lambda motor: motor.refit.fit or None),
    "ended_at": (str, "", lambda motor: motor.refit.ended_at),
    "previous_fit": (str, "", lambda motor: motor.before and motor.before.fit),
    "previous_ended_at": (str, "", lambda motor: motor.before and motor.before.ended_at),
    "previous_effects": (str, "", lambda motor: motor.before and " ".join(motor.before.effects)),
    "previous_shared_runs": (
        int, "",
        lambda motor: motor.before and len({*motor.refit.training} & {*motor.before.training}),
    ),
    "error": (str, "", lambda motor: motor.refit.error or None),
    "warnings": (
        int, "", lambda motor: len(motor.refit.warnings) if motor.refit.estimates else None
    ),
    "first_warning": (str, "", lambda motor: next(iter(motor.refit.warnings), None)),
}  # fmt: skip
COLUMNS = {name: (kind, unit) for name, (kind, unit, _) in _TABLE.items()}
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
    pooled: list[dict[str, Quantiles]] = [{} for _ in refits]
    for pool in pools_of(refits):
        for number, quantiles in pool.motors.items():
            pooled[number][pool.name] = quantiles
    found = zip(refits, drifts(refits), explanations(refits), pooled, strict=True)
    motors = [
        _Motor(refit, refit.previous, changes, change or Explanation((), None), shared)
        for refit, changes, change, shared in found
    ]
    return [{name: cell(one) for name, (_, _, cell) in _TABLE.items()} for one in motors]


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
    writer.writerows({name: csv_cell(value) for name, value in row.items()} for row in rows)
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
    kinds = {str: "string", float: "float64", bool: "bool", int: "int64"}
    fields = [
        pyarrow.field(name, kinds[kind], metadata={"unit": unit} if unit else None)
        for name, (kind, unit) in COLUMNS.items()
    ]
    table = pyarrow.Table.from_pylist([dict(row) for row in rows], schema=pyarrow.schema(fields))
    content = io.BytesIO()
    parquet.write_table(table, content)
    return content.getvalue()


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


def csv_cell(value: object) -> object:
    """CSV cell; an apostrophe precedes any text that a spreadsheet would read as a formula.

    Source:
        OWASP, "CSV Injection": the signs, their full-width forms, and separators within a cell.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _FORMULA.sub(r"\1'", _CONTROL.sub(" ", value))
    return value
