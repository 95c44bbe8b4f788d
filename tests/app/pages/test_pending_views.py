"""Pending runs as shown on the page."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from app.pages.pending import pending_view
from app.tables import PendingRow


def shown(correction: str) -> str:
    """Correction of a contradiction as the page gives it."""
    finding = {
        "file": "run.csv", "severity": "refuse", "column": "current_A",
        "message": "has the wrong sign", "corrections": [correction], "code": "reversed_channel",
    }  # fmt: skip
    found: dict[str, Any] = {
        "preview": {"findings": [finding], "errors": []},
        "summary": None,
        "suggested": {},
        "columns": [],
    }
    row = SimpleNamespace(id="run_1", file="run.csv", found=found, mapping=None, motor="", bench="")
    [view] = pending_view(cast(PendingRow, row))["findings"]
    [words] = view["corrections"]
    return str(words)


@pytest.mark.parametrize(
    ("correction", "words"),
    [
        ("run.csv:current_A=i * -1", "current from column i, sign −"),
        (
            "run.csv:current_A=I [mA] * 2.5 in mA",
            "current from column I [mA], sign +, unit mA, factor 2.5",
        ),
        ("run.csv:current_A=speed in A", "current from speed in A"),
        ("run.csv:position_rad=", "shaft angle from no column"),
    ],
)
def test_correction_is_given_in_the_fields_of_the_page(correction: str, words: str) -> None:
    """Column, sign, unit and factor are the menus and fields beside the plots."""
    assert shown(correction) == words


def test_fault_of_a_cell_is_given_with_its_position() -> None:
    """The page names row and column, as the command line does."""
    fault = {"code": "not_a_number", "message": "'x' is not a number", "row": 412, "column": "i"}
    found: dict[str, Any] = {
        "preview": {"findings": [], "errors": [fault]},
        "summary": None,
        "suggested": {},
        "columns": [],
    }
    row = SimpleNamespace(id="run_1", file="run.csv", found=found, mapping=None, motor="", bench="")

    [shown_fault] = pending_view(cast(PendingRow, row))["errors"]

    assert shown_fault["text"] == "row 412, column i: 'x' is not a number"


def test_a_contradiction_of_a_readable_file_is_shown_once() -> None:
    """The warnings of a run repeat its contradictions, which have a place of their own."""
    finding = {
        "file": "run.csv", "severity": "refuse", "column": "current_A",
        "message": "has the wrong sign", "corrections": [], "code": "reversed_channel",
    }  # fmt: skip
    repeated = {"code": "reversed_channel", "message": "has the wrong sign", "column": "current_A"}
    other = {"code": "no_temperature", "message": "no temperature", "column": None}
    found: dict[str, Any] = {
        "preview": {"findings": [finding], "errors": [], "mapping": {}},
        "summary": {
            "rows": 100, "sample_rate_hz": 100.0, "duration_s": 1.0,
            "channels": {}, "warnings": [repeated, other],
        },
        "suggested": {},
        "columns": [],
    }  # fmt: skip
    row = SimpleNamespace(id="run_1", file="run.csv", found=found, mapping=None, motor="", bench="")

    view = pending_view(cast(PendingRow, row))

    assert len(view["findings"]) == 1
    assert [warning["code"] for warning in view["warnings"]] == ["no_temperature"]
