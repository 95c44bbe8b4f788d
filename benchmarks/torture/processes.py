"""Processes of the machine, as listed by the system."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

__all__ = [
    "children",
    "is_running",
    "kill",
    "machine_seconds",
    "marked",
    "fork_servers",
    "tree_seconds",
]

_TICKS = os.sysconf("SC_CLK_TCK")


def _all() -> Iterator[int]:
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            yield int(entry.name)


def _state(process: int) -> tuple[str, int]:
    """State and parent; of a process that is gone, that of one that has ended."""
    try:
        text = Path(f"/proc/{process}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return "Z", 0
    state, parent = text.rsplit(")", 1)[1].split()[:2]
    return state, int(parent)


def is_running(process: int) -> bool:
    """Whether a process has not ended; one that only waits to be counted has."""
    return _state(process)[0] != "Z"


def children(process: int) -> list[int]:
    """Processes that a process started and that have not ended."""
    states = {found: _state(found) for found in _all()}
    return [
        found for found, (state, parent) in states.items() if parent == process and state != "Z"
    ]


def fork_servers(process: int) -> list[int]:
    """Fork servers of the fits of a server or of a worker of a cluster."""
    return [child for child in children(process) if b"app.fits.worker" in _read(child, "cmdline")]


def marked(mark: str) -> list[int]:
    """Processes that run with a word in their environment, this one left out."""
    found = [
        process
        for process in _all()
        if process != os.getpid() and mark.encode() in _read(process, "environ")
    ]
    return [process for process in found if _state(process)[0] != "Z"]


def machine_seconds() -> float:
    """Processor time that the whole machine has spent since it started, idling left out [s]."""
    words = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _, _, interrupts, soft_interrupts, stolen = map(int, words[:8])
    return (user + nice + system + interrupts + soft_interrupts + stolen) / _TICKS


def tree_seconds(process: int) -> float:
    """Processor time of a process, of those it waited for, and of all below it [s]."""
    words = _read(process, "stat").rsplit(b")", 1)[-1].split()
    own = sum(map(int, words[11:15])) / _TICKS if words else 0.0
    return own + sum(map(tree_seconds, children(process)))


def kill(process: int) -> bool:
    """End a process as a loss of power would; False where it was gone already."""
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


def _read(process: int, name: str) -> bytes:
    try:
        return Path(f"/proc/{process}/{name}").read_bytes()
    except OSError:
        return b""
