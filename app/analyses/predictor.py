"""Prediction or design of a run, or tuning of a loop, in a child process with limits.

A run file is untrusted, so the server itself never reads it.  See `app.analyses.prediction` for the
server's side.  Messages, one JSON object per line:

    {"table": "0.0,0.1,2.0 ..."}          table, if requested, in several messages
    {"prediction": {...}}                 errors and the samples to plot; the last message
    {"design": {...}}                     expected gain of a designed run; the last message
    {"tuning": {...}}                     content of the file of `motorid tune`; the last message
    {"error": {"detail": "..."}}          the run, the result or the request is not accepted
"""

from __future__ import annotations

from typing import Any

import pandas as pd

from app.fork_server.child import Answers, ProcessLimits, confine
from identification.design import (
    DesignOptions,
    profile_csv,
    proposal_entry,
    propose,
    task_of_nameplate,
    task_of_result,
)
from identification.errors import IdentificationError
from identification.ingest import Limits, Run, read_run
from identification.prediction import predict
from identification.remarks import remarks_on
from identification.reporting.columns import extremes
from identification.result.entries import finite_or_null
from identification.result.report_data import RunTraces
from identification.result.residuals import channel_errors
from identification.tuning import motor_of, parse_specification, tune

__all__ = ["handle"]

_ROWS = 5000
_CHARACTERS = 100_000
_BUCKETS = 350


def handle(task: dict[str, Any], answer: int) -> None:
    """Predict a run and report its errors.

    Args:
        task: `kind`, `limits`, and `result` as in result.json.  For a prediction, `path`, `name`,
            `mapping` and `max_rows` of the run, `declared` for the nominal model, and `has_table`
            to send the table.  For a design, its `options`, and a `nameplate` in place of a result.
            For a tuning, the `options` of `tune`, `draws` and a `specification`.
        answer: Write end of the pipe to the server.
    """
    confine(ProcessLimits(**task["limits"]))
    answers = Answers(answer)
    try:
        _COMPUTED[task["kind"]](task, answers)
    except IdentificationError as error:
        answers.send({"error": {"detail": str(error)}})
    except MemoryError:
        answers.send({"error": {"detail": "memory"}})


def _predict(task: dict[str, Any], answers: Answers) -> None:
    limits = Limits(rows=task["max_rows"])
    run = read_run(task["path"], name=task["name"], mapping=task["mapping"], limits=limits)
    prediction = predict(task["result"], run, task["declared"])
    if task["has_table"]:
        _send_table(prediction, answers)
    answers.send({"prediction": finite_or_null(_summary(run, prediction, task["result"]))})


def _design(task: dict[str, Any], answers: Answers) -> None:
    options = DesignOptions(**task["options"])
    if task["result"] is None:
        motor = task_of_nameplate(task["nameplate"], options)
    else:
        motor = task_of_result(task["result"], options)
    proposal = propose(motor)
    table = profile_csv(proposal)
    for first in range(0, len(table), _CHARACTERS):
        answers.send({"table": table[first : first + _CHARACTERS]})
    answers.send({"design": proposal_entry(proposal)})


def _tune(task: dict[str, Any], answers: Answers) -> None:
    motor = motor_of(task["draws"], task["result"])
    found = tune(motor, parse_specification(task["specification"]), **task["options"])
    answers.send({"tuning": finite_or_null(found)})


def _send_table(prediction: pd.DataFrame, answers: Answers) -> None:
    """Send the rows; a sample without a prediction, between two records, has empty cells."""
    for first in range(0, len(prediction), _ROWS):
        rows = prediction.iloc[first : first + _ROWS]
        answers.send({"table": rows.to_csv(index=False, header=not first, lineterminator="\n")})


def _summary(run: Run, prediction: pd.DataFrame, result: dict[str, Any]) -> dict[str, Any]:
    traces = RunTraces(
        name=run.name,
        role="validation",
        time=run.time,
        voltage=run.voltage,
        temperature=run.temperature,
        measured_current=run.used("current_A"),
        measured_speed=run.used("speed_rad_s"),
        after_current=prediction["current_A"].to_numpy(),
        after_speed=prediction["speed_rad_s"].to_numpy(),
    )
    noise = result.get("noise") or {}
    kept = extremes(
        [traces.measured_speed, traces.after_speed, traces.measured_current, traces.after_current],
        _BUCKETS,
    )
    return {
        "rows": run.rows,
        "remarks": remarks_on(result, run, prediction),
        "errors": {
            "current": _errors(traces, "current", noise.get("current_A")),
            "speed": _errors(traces, "speed", noise.get("speed_rad_s")),
        },
        "plot": {
            "time": run.time[kept],
            "speed": [traces.measured_speed[kept], traces.after_speed[kept]],
            "current": [traces.measured_current[kept], traces.after_current[kept]],
        },
    }


def _errors(traces: RunTraces, channel: str, noise: float | None) -> dict[str, float | None]:
    found = channel_errors(traces, channel)
    if found is None:
        return {"rmse": None, "nrmse": None, "noise_ratio": None}
    ratio = found.rmse / noise if noise else None
    return {"rmse": found.rmse, "nrmse": found.nrmse, "noise_ratio": ratio}


_COMPUTED = {"prediction": _predict, "design": _design, "tuning": _tune}
