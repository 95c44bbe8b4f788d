"""Tasks in children of the fork server: messages, exit and cleanup."""

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
    """Fork server for the test tasks."""
    made = ForkServer(
        "tests.app.fork_server.tasks", temporary=tmp_path_factory.mktemp("fork_server")
    )
    yield made
    made.stop()


def heard(task: Task) -> list[dict[str, Any]]:
    """All messages of a task until it has ended."""
    told: list[dict[str, Any]] = []
    deadline = time.monotonic() + 30
    while not task.has_ended and time.monotonic() < deadline:
        told += task.messages(wait_s=1.0)
    task.kill()
    return told


def first(task: Task) -> dict[str, Any]:
    """First message of a task."""
    while not (told := task.messages(wait_s=30.0)):
        assert not task.has_ended
    return told[0]


def are_gone(pids: list[int]) -> bool:
    """Return True if all processes end within ten seconds."""
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
def test_messages_of_a_task_end_with_its_exit_code(
    fork_server: ForkServer, task: dict[str, Any], told: list[dict[str, Any]]
) -> None:
    """Invalid messages are dropped; a signal gives a negative exit code."""
    assert heard(fork_server.fork(task)) == told


def test_kill_ends_a_task_with_its_children(fork_server: ForkServer) -> None:
    """The task reports the IDs of its process and of its child."""
    task = fork_server.fork({"family": "stays"})
    pids = first(task)["pids"]

    began = time.monotonic()
    task.kill()
    took = time.monotonic() - began

    assert task.has_ended
    assert took < 1.0
    assert are_gone(pids)


def test_children_of_a_task_end_with_it(fork_server: ForkServer) -> None:
    """The task exits and leaves a child behind, which is killed."""
    task = fork_server.fork({"family": "is left"})
    pids = first(task)["pids"]

    heard(task)

    assert are_gone(pids)


def test_parallel_tasks_do_not_mix(fork_server: ForkServer) -> None:
    """Each of thirty parallel tasks returns its own number."""
    tasks = [fork_server.fork({"echo": number}) for number in range(30)]

    assert [heard(task)[0]["echo"] for task in tasks] == list(range(30))


def test_end_of_the_fork_server_gives_no_exit_message(fork_server: ForkServer) -> None:
    """Its children end, and the next task runs in a new fork server."""
    task = fork_server.fork({"family": "stays"})
    pids = first(task)["pids"]
    assert fork_server.pid is not None

    os.kill(fork_server.pid, signal.SIGKILL)

    assert heard(task) == []
    assert are_gone(pids[:1])
    os.kill(pids[1], signal.SIGKILL)
    assert heard(fork_server.fork({"echo": 1}))[0] == {"echo": 1}


def test_stopped_fork_server_kills_its_descendants(tmp_path: Path) -> None:
    """Fork server, child and grandchild end without delay."""
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
    """Running and later tasks are not affected, and the process remains the same."""
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
def test_malformed_task_affects_only_its_child(fork_server: ForkServer, content: bytes) -> None:
    """The child parses the task, so its content cannot affect the fork server."""
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


def test_full_pipe_of_an_ended_task_blocks_no_other(fork_server: ForkServer) -> None:
    """The exit message waits until the pipe has space."""
    unread = [fork_server.fork({"fills": 1}) for _ in range(3)]
    time.sleep(0.5)

    began = time.monotonic()
    assert heard(fork_server.fork({"echo": 1})) == [{"echo": 1}, {"exit": 0}]
    assert time.monotonic() - began < 5
    assert [heard(task) for task in unread] == [[{"exit": 0}]] * 3


def test_task_works_with_a_thousand_open_files(fork_server: ForkServer) -> None:
    """A busy server has descriptors above 1024, which `select` cannot handle."""
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
