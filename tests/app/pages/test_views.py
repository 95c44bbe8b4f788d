"""Numbers and times as formatted for the web pages."""

from __future__ import annotations

import pytest

from app.fits.schemas import FitSummary, Progress
from app.pages.analysis_views import by_motor
from app.pages.views import fit_view, run_view, span
from app.runs.schemas import RunOut
from app.tables import RunRow
from tests.app.rows import fit_row

RUN = RunOut.model_json_schema()["examples"][0]
FIT = FitSummary.model_json_schema()["examples"][0]


def test_run_is_shown_with_units() -> None:
    """A channel that the run does not have is a dash."""
    channels = {name: span for name, span in RUN["channels"].items() if name != "temperature_degC"}

    shown = run_view(RunOut.model_validate(RUN | {"channels": channels}))

    assert shown["rows"] == "24\u202f000"
    assert shown["ranges"]["voltage_V"] == "\u221212 … 12 V"
    assert shown["ranges"]["temperature_degC"] == "–"
    assert shown["received"] == "2026-11-21 12:00 UTC"


def test_thousands_are_written_without_an_exponent() -> None:
    """A speed of 31 580 rpm is 3307 rad/s, not 3.31e+03."""
    assert span("speed_rad_s", -3012.4, 3306.8) == "\u22123012 … 3307 rad/s"


def test_warnings_of_a_run_name_the_column() -> None:
    """A warning about a channel begins with its column."""
    dead = {"code": "constant_channel", "message": "never moves", "column": "current_A"}
    whole = {"code": "no_temperature", "message": "no temperature"}

    shown = run_view(RunOut.model_validate(RUN | {"warnings": [dead, whole]}))

    assert shown["warnings"] == ["column current_A: never moves", "no temperature"]


@pytest.mark.parametrize(
    ("ended", "took"),
    [
        (None, ""),
        ("2026-11-21T12:00:30.220000Z", "30.1 s"),
        ("2026-11-21T12:05:00.120000Z", "5 min 0 s"),
        ("2026-11-21T14:30:00.120000Z", "2 h 30 min"),
    ],
)
def test_duration_of_a_fit_is_shown_in_suitable_units(ended: str | None, took: str) -> None:
    """The start time of the example is 12:00:00.12."""
    assert fit_view(FitSummary.model_validate(FIT | {"ended_at": ended}), {})["took"] == took


@pytest.mark.parametrize(
    ("remaining_s", "shown"),
    [
        (None, "posterior · 62 %"),
        (0.2, "posterior · 62 % · about 1 s left"),
        (40.4, "posterior · 62 % · about 40 s left"),
        (150.0, "posterior · 62 % · about 2 min 30 s left"),
    ],
)
def test_progress_names_stage_percent_and_time_left(remaining_s: float | None, shown: str) -> None:
    """Seconds are whole; less than one is not worth a digit."""
    progress = {"stage": "posterior", "fraction": 0.62, "remaining_s": remaining_s}

    assert (
        fit_view(FitSummary.model_validate(FIT | {"progress": progress}), {})["progress_text"]
        == shown
    )


@pytest.mark.parametrize(
    ("status", "fraction", "remaining_s"),
    [("running", 0.25, 90.0), ("running", 0.04, None), ("queued", 0.0, None)],
)
def test_remaining_time_follows_from_the_time_so_far(
    status: str, fraction: float, remaining_s: float | None
) -> None:
    """A quarter took 30 s, so three quarters take 90 s."""
    row = fit_row("w", status)
    row.fraction, row.started_at = fraction, 1000.0

    assert Progress.of(row, 1030.0).remaining_s == remaining_s


def test_runs_of_a_fit_are_shown_by_name_if_known() -> None:
    """A run with an unknown name is shown by its ID."""
    fit = FitSummary.model_validate(FIT | {"validation": ["run_x"]})

    shown = fit_view(fit, {FIT["training"][0]: "a.csv"})

    assert (shown["training"], shown["validation"]) == (["a.csv"], ["run_x"])


def test_option_that_was_not_given_is_a_dash() -> None:
    """None and empty values are dashes; 0 and False are shown."""
    given: dict[str, object] = {"time_limit": None, "known": [], "nameplate": ""}
    options = given | {"seed": 0, "force": False}

    shown = fit_view(FitSummary.model_validate(FIT | {"options": options}), {})["options"]

    assert shown == {
        "time_limit": "–", "known": "–", "nameplate": "–", "seed": "0", "force": "no",
    }  # fmt: skip


def test_runs_to_predict_are_sorted_by_motor() -> None:
    """The motor of the fit is first; within a motor the order remains."""
    named = [("r1", "b"), ("r2", None), ("r3", "a"), ("r4", "c"), ("r5", "b")]
    rows = [RunRow(id=run, motor=motor) for run, motor in named]

    assert [run.id for run in by_motor(rows, "c")] == ["r4", "r3", "r1", "r5", "r2"]
