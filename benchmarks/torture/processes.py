"""Processes of the machine, read from the kernel."""

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
    """State and parent of a process; a missing process counts as ended."""
    try:
        text = Path(f"/proc/{process}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return "Z", 0
    state, parent = text.rsplit(")", 1)[1].split()[:2]
    return state, int(parent)


def is_running(process: int) -> bool:
    """Return True if a process exists and is no zombie."""
    return _state(process)[0] != "Z"


def children(process: int) -> list[int]:
    """Child processes that have not ended."""
    states = {found: _state(found) for found in _all()}
    return [
        found for found, (state, parent) in states.items() if parent == process and state != "Z"
    ]


def fork_servers(process: int) -> list[int]:
    """Fork servers of a server or of a worker of a cluster."""
    return [child for child in children(process) if b"app.fits.worker" in _read(child, "cmdline")]


def marked(mark: str) -> list[int]:
    """Processes with a given text in their environment, except this one."""
    found = [
        process
        for process in _all()
        if process != os.getpid() and mark.encode() in _read(process, "environ")
    ]
    return [process for process in found if _state(process)[0] != "Z"]


def machine_seconds() -> float:
    """Processor time of the whole machine since its start, without idle time [s]."""
    words = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _, _, interrupts, soft_interrupts, stolen = map(int, words[:8])
    return (user + nice + system + interrupts + soft_interrupts + stolen) / _TICKS


def tree_seconds(process: int) -> float:
    """Processor time of a process and its descendants, including ended children [s]."""
    words = _read(process, "stat").rsplit(b")", 1)[-1].split()
    own = sum(map(int, words[11:15])) / _TICKS if words else 0.0
    return own + sum(map(tree_seconds, children(process)))


def kill(process: int) -> bool:
    """Kill a process with signal 9; return False if it no longer exists."""
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
