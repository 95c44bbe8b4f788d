"""Fleet table: columns, cells, and equal content in each format."""

from __future__ import annotations

import builtins
import csv
import dataclasses
import io
import json
import re
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.fleet.refit import Refit, refit_of
from identification.fleet.table import COLUMNS, MissingParquet, csv_text, parquet_bytes, rows_of
from identification.quantities import DECLARED_PARAMETERS
from tests.fleet.fleets import fleet

parquet = pytest.importorskip("pyarrow.parquet")


def test_row_has_every_parameter_with_interval_and_drift() -> None:
    """Reference: the columns that docs/batch.md lists, for each of the seven parameters."""
    (row,) = rows_of(fleet(1))

    assert list(row) == list(COLUMNS)
    for name in DECLARED_PARAMETERS:
        for ending in ("_sd", "_q05", "_q95", "_drift", "_drift_relative", "_drift_sds"):
            assert isinstance(row[f"{name}{ending}"], float)
        assert row[f"{name}_drift"] == pytest.approx(row[name] - _before(name))
        assert isinstance(row[f"{name}_drift_significant"], bool)


def _before(name: str) -> float:
    previous = fleet(1)[0].previous
    assert previous is not None
    return previous.estimates[name].median or 0.0


def test_result_without_parts_is_a_row_with_empty_cells() -> None:
    """A result that contains only its schema version gives empty cells and no error."""
    (row,) = rows_of([refit_of("m", "fitted", {"schema_version": 1})])

    assert {n for n, v in row.items() if v not in (None, "")} == {"motor", "status"}
    assert len(csv_text([row]).splitlines()) == 2


def test_noise_ratios_and_effects_come_from_the_final_model() -> None:
    """The row shows `errors.after` by role and the names of `effects` in order."""
    result = {
        "errors": {
            "before": {"training": {"current": {"noise_ratio": 9.0}}},
            "after": {"training": {"current": {"noise_ratio": 1.1}, "speed": {"noise_ratio": 1.2}},
                      "validation": None},
        },
        "effects": [{"name": "brush_drop"}, {"name": "coulomb_friction"}],
    }  # fmt: skip

    (row,) = rows_of([refit_of("m", "fitted", result)])

    assert row["training_noise_ratio_current"] == 1.1
    assert row["training_noise_ratio_speed"] == 1.2
    assert row["validation_noise_ratio_speed"] is None
    assert row["effects"] == "brush_drop coulomb_friction"


def test_first_warning_and_their_number_are_in_the_row() -> None:
    """A contradicted known value is the first warning; a motor without a result has none."""
    result = {"parameters": {"J": {"median": 1e-4}}, "warnings": ["Kt25 is 7 by --known", "gap"]}

    said, silent, failed = rows_of(
        [refit_of("m", "fitted", result), refit_of("n", "fitted", result | {"warnings": []}),
         Refit("o", "failed", error="no")]
    )  # fmt: skip

    assert (said["warnings"], said["first_warning"]) == (2, "Kt25 is 7 by --known")
    assert (silent["warnings"], silent["first_warning"]) == (0, None)
    assert (failed["warnings"], failed["first_warning"]) == (None, None)


def test_runs_that_both_refits_share_are_counted() -> None:
    """Shared runs have shared noise, which the combined standard deviation neglects."""
    refit = fleet(1)[0]
    assert refit.previous is not None
    shared = dataclasses.replace(refit, training=("a", *refit.previous.training))

    assert rows_of([refit])[0]["previous_shared_runs"] == 0
    assert rows_of([shared])[0]["previous_shared_runs"] == 1


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["", " ", "\t", "\r", "\n"]),
    st.sampled_from("=+-@\uff1d\uff0b\uff0d\uff20"),
    st.text(min_size=1, max_size=8).filter(
        lambda text: text.isprintable() and text.strip() and not {*text} & {*";,"}
    ),
)
def test_no_cell_begins_like_a_formula(gap: str, sign: str, text: str) -> None:
    """Text that a spreadsheet would evaluate gets an apostrophe, and line breaks are removed."""
    failed = Refit(motor=gap + sign + text, status="failed", error=gap + sign + text)

    (line,) = csv.DictReader(io.StringIO(csv_text(rows_of([failed])), newline=""))

    assert line["motor"] == line["error"] == f"'{' ' if gap else ''}{sign}{text}"


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("x;=1+1", "x;'=1+1"),
        ("x, @sum(a1)", "x,' @sum(a1)"),
        ("x;\t-1", "x;' -1"),
        ("x\n=1", "x =1"),
        ("\uff1d1+1", "'\uff1d1+1"),
        ("=1;=2", "'=1;'=2"),
        ("a-b; c+d, e@f", "a-b; c+d, e@f"),
        ("it's 5 = 5", "it's 5 = 5"),
        ("-", "-"),
    ],
)
def test_no_part_of_a_cell_begins_like_a_formula(text: str, cell: str) -> None:
    """Spreadsheets that split at `;` or `,` see no formula either; signs inside a text stay."""
    row = {"motor": text, "status": "failed", "Ra25_drift": -0.5}

    (line,) = csv.DictReader(io.StringIO(csv_text([row]), newline=""))

    assert line["motor"] == cell
    assert line["Ra25_drift"] == "-0.5"


@given(st.text(alphabet="ab ;,=+-@\uff1d\uff20", max_size=12))
def test_text_comes_back_without_the_apostrophes(text: str) -> None:
    """Without the inserted apostrophes (docs/batch.md, "The table") the text is unchanged."""
    (line,) = csv.DictReader(io.StringIO(csv_text([{"motor": text, "error": "e"}]), newline=""))

    assert line["motor"].replace("'", "") == text
    signs = tuple("=+-@\uff1d\uff20")
    parts = [part.strip() for part in re.split("[;,]", line["motor"])]
    assert not any(part.startswith(signs) for part in parts if len(part) > 1)


def test_numbers_read_back_exactly_in_each_form() -> None:
    """CSV with all digits, JSON and Parquet contain the same doubles."""
    rows = rows_of([*fleet(3), Refit("bad", "failed", error="x")])
    numbers = [name for name, (kind, _) in COLUMNS.items() if kind is float]

    lines = list(csv.DictReader(io.StringIO(csv_text(rows))))
    table = parquet.read_table(io.BytesIO(parquet_bytes(rows)))

    assert json.loads(json.dumps(rows, allow_nan=False)) == rows
    assert table.to_pylist() == rows
    for row, line in zip(rows, lines, strict=True):
        read = {n: float(line[n]) if line[n] else None for n in numbers}
        assert read == {n: row[n] for n in numbers}
    assert lines[0]["Ra25_identified"] == "true"
    assert table.schema.field("Ra25_sd").metadata == {b"unit": b"ohm"}


def test_missing_parquet_package_gives_the_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names the extra to install and the other formats."""
    real = builtins.__import__

    def without(name: str, *args: Any, **more: Any) -> Any:
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return real(name, *args, **more)

    monkeypatch.setattr(builtins, "__import__", without)

    with pytest.raises(MissingParquet, match=r"pip install 'motorid\[parquet\]', or use the CSV"):
        parquet_bytes(rows_of(fleet(1)))
