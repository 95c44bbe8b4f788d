"""CSV table of an export."""

from __future__ import annotations

import csv
import io
from typing import Any

from identification.export import export
from identification.export.formats import csv_table
from tests.export.results import FRICTION, result_with


def rows_of(result: dict[str, Any]) -> list[dict[str, str]]:
    """Rows of the table of a result."""
    content = export(result, "csv", lambda: ({}, "")).content.decode()
    return list(csv.DictReader(io.StringIO(content)))


def test_table_has_parameters_effects_and_metrics_with_their_numbers() -> None:
    """The numbers are those of the result, with their full precision."""
    rise = {"mean": 0.1, "sd": 0.01, "q05": 0.09, "median": 0.1, "q95": None, "unit": "s"}
    loop = {"temperature_degC": 25.0, "controller": "P:1", "rise_time_s": rise}
    result = result_with(FRICTION) | {"feedback": [loop]}

    rows = {(row["group"], row["name"]): row for row in rows_of(result)}

    assert float(rows["parameters", "Ra25"]["median"]) == 0.6
    assert rows["parameters", "Ra25"]["identified"] == "true"
    assert float(rows["effects", "coulomb_friction.torque"]["median"]) == 0.02
    metric = rows["feedback", "rise_time_s"]
    assert (metric["temperature_degC"], metric["controller"], metric["q95"]) == ("25.0", "P:1", "")
    assert metric["unit"] == "s"


def test_unit_of_a_ratio_is_no_formula() -> None:
    """A sign alone is text in every spreadsheet, so that it needs no mark."""
    entry = {"mean": 1.0, "sd": 0.1, "q05": 0.8, "median": 1.0, "q95": 1.2, "unit": "-"}

    assert "'-" not in csv_table({"parameters": {"ratio": entry}})


def test_text_that_a_spreadsheet_would_evaluate_is_marked() -> None:
    """A controller text of an edited result cannot become a formula."""
    loop = {"temperature_degC": 25.0, "controller": "=1+1", "rise_time_s": {"unit": "s"}}

    (row,) = [r for r in rows_of(result_with() | {"feedback": [loop]}) if r["group"] == "feedback"]

    assert row["controller"] == "'=1+1"
