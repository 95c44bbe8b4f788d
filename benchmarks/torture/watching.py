"""Memory use of processes, read from the kernel while they run."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Watch", "children", "resident_bytes", "watching"]

_LOOK_S = 0.02


@dataclass
class Watch:
    """Maxima of the observed memory use.

    Args:
        resident: Memory of the process itself [bytes].
        child_space: Address space of a process below it [bytes].
        child_resident: Memory of a process below it [bytes].
    """

    resident: int = 0
    child_space: int = 0
    child_resident: int = 0


def _status(pid: int) -> dict[str, int]:
    """Sizes of a process from its status file [bytes]; empty if it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return {}
    words = (line.split() for line in lines if line.endswith(" kB"))
    return {name.rstrip(":"): 1024 * int(size) for name, size, _ in words}


def resident_bytes(pid: int) -> int:
    """Resident memory of a process [bytes]."""
    return _status(pid).get("VmRSS", 0)


def children(pid: int) -> Iterator[int]:
    """All descendants of a process."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        found = [int(c) for task in tasks for c in (task / "children").read_text().split()]
    except OSError:
        return
    for child in found:
        yield child
        yield from children(child)


@contextmanager
def watching(pid: int) -> Iterator[Watch]:
    """Observe a process and its descendants within a block."""
    watch, is_over = Watch(), threading.Event()

    def look() -> None:
        while not is_over.is_set():
            watch.resident = max(watch.resident, resident_bytes(pid))
            for child in children(pid):
                status = _status(child)
                watch.child_space = max(watch.child_space, status.get("VmPeak", 0))
                watch.child_resident = max(watch.child_resident, status.get("VmHWM", 0))
            time.sleep(_LOOK_S)

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    try:
        yield watch
    finally:
        is_over.set()
        thread.join()
