"""Answers of the process that predicts a run, as the server takes them."""

from __future__ import annotations

import io
import signal
from typing import Any, cast

import pytest

from app.analyses.prediction import Predictor
from app.errors import BadRequest, RunRefused, Unavailable
from app.fork_server.child import ProcessLimits
from app.fork_server.client import ForkServer, Task

ERRORS = {"rmse": 0.1, "nrmse": 0.01, "noise_ratio": 1.0}
FOUND = {"rows": 3, "errors": {"current": ERRORS, "speed": ERRORS}, "plot": {"time": [0.0]}}


class Answering:
    """Task that gives these messages."""

    def __init__(self, *messages: dict[str, Any]) -> None:
        self._messages = list(messages)
        self.has_ended = False
        self.was_killed = False

    def messages(self, wait_s: float) -> list[dict[str, Any]]:
        """One message in each call."""
        self.has_ended = len(self._messages) <= 1
        return [self._messages.pop(0)] if self._messages else []

    def kill(self) -> None:
        """End the task."""
        self.was_killed = True


class Starting(ForkServer):
    """Fork server whose only task is given."""

    def __init__(self, task: Answering) -> None:
        self._task = task

    def fork(self, task: dict[str, Any]) -> Task:
        """Start the task."""
        return cast(Task, self._task)


def always() -> bool:
    """Return True: the answer is wanted."""
    return True


def predictor(*messages: dict[str, Any]) -> Predictor:
    """Predictor whose process sends these messages."""
    limits = ProcessLimits(2_000_000_000, cpu_s=60, wall_s=120.0)
    return Predictor(Starting(Answering(*messages)), limits, 1000)


def test_rows_of_all_messages_are_written_in_order() -> None:
    """The table begins with its header; rows that nobody asked for are dropped."""
    rows = ({"table": "0,1,2\n"}, {"table": "1,,\n"}, {"prediction": FOUND}, {"exit": 0})
    table = io.BytesIO()

    found = predictor(*rows).answer("prediction", "a.csv", {}, always, table)
    without = predictor(*rows).answer("prediction", "a.csv", {}, always)

    assert table.getvalue() == b"0,1,2\n1,,\n"
    assert found == without == FOUND


@pytest.mark.parametrize(
    ("message", "error", "words"),
    [
        ({"error": {"detail": "the result has no value of J"}}, RunRefused, "no value of J"),
        ({"error": {"detail": "memory"}}, RunRefused, "2 GB of memory"),
        ({"exit": -signal.SIGKILL}, RunRefused, "2 GB of memory"),
        ({"exit": -signal.SIGXCPU}, RunRefused, "more than 60 s"),
        ({"exit": 1}, RunRefused, "crashed"),
        ({"refused": "x"}, Unavailable, "try again"),
    ],
)
def test_end_without_a_prediction_has_a_reason(
    message: dict[str, Any], error: type[Exception], words: str
) -> None:
    """A limit names the command that has none."""
    with pytest.raises(error, match=words):
        predictor(message).answer("prediction", "a.csv", {}, always)


def test_computation_that_nobody_waits_for_is_killed() -> None:
    """The client disconnects after the first look, and the task has not ended by then."""
    task = Answering({"table": "0,1,2\n"}, {"prediction": FOUND}, {"exit": 0})
    looks = iter([True, False])
    made = Predictor(Starting(task), ProcessLimits(2_000_000_000, cpu_s=60, wall_s=120.0), 1000)

    with pytest.raises(BadRequest, match="the client disconnected"):
        made.answer("prediction", "a.csv", {}, lambda: next(looks))

    assert task.was_killed
