"""Tasks in children of a nursery: what they tell, how they end, what is left of them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.nursery.client import Nursery, Task


@pytest.fixture(scope="module")
def nursery(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nursery]:
    """A nursery of small tasks."""
    made = Nursery("tests.app.nursery.tasks", temporary=tmp_path_factory.mktemp("nursery"))
    yield made
    made.stop()


def heard(task: Task) -> list[dict[str, Any]]:
    """Everything that a task tells until it has ended."""
    told: list[dict[str, Any]] = []
    deadline = time.monotonic() + 30
    while not task.has_ended and time.monotonic() < deadline:
        told += task.messages(wait_s=1.0)
    task.kill()
    return told


def first(task: Task) -> dict[str, Any]:
    """What a task tells first."""
    while not (told := task.messages(wait_s=30.0)):
        assert not task.has_ended
    return told[0]


def are_gone(pids: list[int]) -> bool:
    """Whether processes end within seconds."""
    deadline = time.monotonic() + 10
    while any(Path(f"/proc/{pid}").exists() for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.01)
    return not any(Path(f"/proc/{pid}").exists() for pid in pids)


@pytest.mark.parametrize(
    ("task", "told"),
    [
        ({"echo": "ä"}, [{"echo": "ä"}, {"exit": 0}]),
        ({"echo": 1, "exit": 3}, [{"echo": 1}, {"exit": 1}]),
        ({"signal": signal.SIGSEGV}, [{"exit": -signal.SIGSEGV}]),
        ({"half": 1}, [{"exit": -signal.SIGKILL}]),
        ({"echo": "x" * 150_000}, [{"echo": "x" * 150_000}, {"exit": 0}]),
    ],
    ids=["well", "error", "signal", "half a line", "long"],
)
def test_task_tells_what_it_has_to_and_how_it_ended(
    nursery: Nursery, task: dict[str, Any], told: list[dict[str, Any]]
) -> None:
    """The last message is the exit, by the numbers of the system; half a line is dropped."""
    assert heard(nursery.fork(task)) == told


def test_kill_ends_a_task_with_what_it_started_at_once(nursery: Nursery) -> None:
    """The task wrote down its process and that of its child."""
    task = nursery.fork({"family": "stays"})
    pids = first(task)["pids"]

    began = time.monotonic()
    task.kill()
    took = time.monotonic() - began

    assert task.has_ended
    assert took < 1.0
    assert are_gone(pids)


def test_what_a_task_started_ends_with_it(nursery: Nursery) -> None:
    """The task ends by itself and leaves a child behind."""
    task = nursery.fork({"family": "is left"})
    pids = first(task)["pids"]

    heard(task)

    assert are_gone(pids)


def test_many_tasks_are_told_apart(nursery: Nursery) -> None:
    """Thirty at once, each with its own number."""
    tasks = [nursery.fork({"echo": number}) for number in range(30)]

    assert [heard(task)[0]["echo"] for task in tasks] == list(range(30))


def test_end_of_the_nursery_is_told_from_an_end_of_the_task(nursery: Nursery) -> None:
    """No exit is told; the children are gone, and the next task runs in a new nursery."""
    task = nursery.fork({"family": "stays"})
    pids = first(task)["pids"]
    assert nursery.pid is not None

    os.kill(nursery.pid, signal.SIGKILL)

    assert heard(task) == []
    assert are_gone(pids[:1])
    os.kill(pids[1], signal.SIGKILL)
    assert heard(nursery.fork({"echo": 1}))[0] == {"echo": 1}


def test_stopped_nursery_takes_its_children_with_it(tmp_path: Path) -> None:
    """Process, child and grandchild; nothing has to be waited for."""
    nursery = Nursery("tests.app.nursery.tasks", temporary=tmp_path)
    task = nursery.fork({"family": "stays"})
    pids = first(task)["pids"]
    process = nursery.pid
    assert process is not None

    began = time.monotonic()
    nursery.stop()

    assert time.monotonic() - began < 5
    assert are_gone([process, *pids])
    assert heard(task) == []
