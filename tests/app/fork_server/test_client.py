"""Tasks in children of a fork server: what they tell, how they end, what is left of them."""

from __future__ import annotations

import os
import resource
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.fork_server.client import ForkServer, Task


@pytest.fixture(scope="module")
def fork_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForkServer]:
    """A fork server of small tasks."""
    made = ForkServer(
        "tests.app.fork_server.tasks", temporary=tmp_path_factory.mktemp("fork_server")
    )
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
        ({"echo": 1, "unread": "ä" * 1_000_000}, [{"echo": 1}, {"exit": 0}]),
        ({"junk": '{"a": }\n{"b": 1}\n[2]\n"c"'}, [{"b": 1}, {"exit": 0}]),
    ],
    ids=["well", "error", "signal", "half a line", "long", "huge task", "junk"],
)
def test_task_tells_what_it_has_to_and_how_it_ended(
    fork_server: ForkServer, task: dict[str, Any], told: list[dict[str, Any]]
) -> None:
    """The last message is the exit, by the numbers of the system; what is no message is dropped."""
    assert heard(fork_server.fork(task)) == told


def test_kill_ends_a_task_with_what_it_started_at_once(fork_server: ForkServer) -> None:
    """The task wrote down its process and that of its child."""
    task = fork_server.fork({"family": "stays"})
    pids = first(task)["pids"]

    began = time.monotonic()
    task.kill()
    took = time.monotonic() - began

    assert task.has_ended
    assert took < 1.0
    assert are_gone(pids)


def test_what_a_task_started_ends_with_it(fork_server: ForkServer) -> None:
    """The task ends by itself and leaves a child behind."""
    task = fork_server.fork({"family": "is left"})
    pids = first(task)["pids"]

    heard(task)

    assert are_gone(pids)


def test_many_tasks_are_told_apart(fork_server: ForkServer) -> None:
    """Thirty at once, each with its own number."""
    tasks = [fork_server.fork({"echo": number}) for number in range(30)]

    assert [heard(task)[0]["echo"] for task in tasks] == list(range(30))


def test_end_of_the_fork_server_is_told_from_an_end_of_the_task(fork_server: ForkServer) -> None:
    """No exit is told; the children are gone, and the next task runs in a new fork server."""
    task = fork_server.fork({"family": "stays"})
    pids = first(task)["pids"]
    assert fork_server.pid is not None

    os.kill(fork_server.pid, signal.SIGKILL)

    assert heard(task) == []
    assert are_gone(pids[:1])
    os.kill(pids[1], signal.SIGKILL)
    assert heard(fork_server.fork({"echo": 1}))[0] == {"echo": 1}


def test_stopped_fork_server_takes_its_children_with_it(tmp_path: Path) -> None:
    """Process, child and grandchild; nothing has to be waited for."""
    fork_server = ForkServer("tests.app.fork_server.tasks", temporary=tmp_path)
    task = fork_server.fork({"family": "stays"})
    pids = first(task)["pids"]
    process = fork_server.pid
    assert process is not None

    began = time.monotonic()
    fork_server.stop()

    assert time.monotonic() - began < 5
    assert are_gone([process, *pids])
    assert heard(task) == []


@pytest.mark.parametrize("message", [b"F", b"Fabc", b"K", b"Kabc", b"{}", b"\xff" * 300])
def test_fork_server_survives_any_message(fork_server: ForkServer, message: bytes) -> None:
    """A task that runs meanwhile ends by itself, in the same process, with what it has to tell."""
    task = fork_server.fork({"family": "stays"})
    first(task)
    process = fork_server.pid
    assert fork_server._socket is not None

    handle = os.open("/dev/null", os.O_RDONLY)
    for handles in ([], [handle], [handle] * 5):
        socket.send_fds(fork_server._socket, [message], handles)
    os.close(handle)

    assert heard(fork_server.fork({"echo": 1})) == [{"echo": 1}, {"exit": 0}]
    assert fork_server.pid == process
    assert not task.has_ended
    task.kill()


@pytest.mark.parametrize("content", [b"", b"{", b"\xff" * 1000, b"[" * 100_000, b"3"])
def test_task_that_cannot_be_read_ends_alone(fork_server: ForkServer, content: bytes) -> None:
    """The child reads the task, so that nothing in it reaches the fork server."""
    beside = fork_server.fork({"family": "stays"})
    first(beside)
    process = fork_server.pid
    incoming, outgoing = os.pipe()
    task, end = os.pipe()
    os.write(end, content[:60_000])
    os.close(end)

    fork_server._send(b"Fbroken", [task, outgoing])
    os.close(outgoing)
    os.close(task)

    assert heard(Task(fork_server, b"broken", incoming)) == [{"exit": 1}]
    assert fork_server.pid == process
    assert not beside.has_ended
    beside.kill()


def test_end_of_a_task_that_nobody_reads_keeps_no_other_waiting(fork_server: ForkServer) -> None:
    """Its pipe is full when it ends, so that there is no room for how it ended."""
    unread = [fork_server.fork({"fills": 1}) for _ in range(3)]
    time.sleep(0.5)

    began = time.monotonic()
    assert heard(fork_server.fork({"echo": 1})) == [{"echo": 1}, {"exit": 0}]
    assert time.monotonic() - began < 5
    assert [heard(task) for task in unread] == [[{"exit": 0}]] * 3


def test_task_is_heard_where_thousands_of_files_are_open(fork_server: ForkServer) -> None:
    """As in a server with many connections: `select` refuses descriptors from 1024 on."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limits[1] < 1200:
        pytest.skip("the system allows too few open files")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(limits[0], 1200), limits[1]))
    held = [os.open("/dev/null", os.O_RDONLY) for _ in range(1100)]
    try:
        task = fork_server.fork({"echo": 1})
        assert heard(task) == [{"echo": 1}, {"exit": 0}]
    finally:
        for handle in held:
            os.close(handle)
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
