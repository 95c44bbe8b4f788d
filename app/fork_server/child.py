"""Child processes of the fork server: resource limits and messages to the client.

A child that handles untrusted input limits itself first; it cannot lift the limits again.  Each
message is one JSON object on a line of the pipe.
"""

from __future__ import annotations

import ctypes
import json
import os
import resource
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = [
    "Answers",
    "ProcessLimits",
    "child_environment",
    "confine",
    "die_with_parent",
    "prefer_as_victim",
]

_PR_SET_PDEATHSIG = 1
_PROGRESS_INTERVAL_S = 0.2
_SECRETS = ("MOTORID_DATABASE_URL", "PGPASSWORD")


@dataclass(frozen=True)
class ProcessLimits:
    """Resource limits of a process."""

    memory_bytes: int
    """Address space [bytes]."""
    cpu_s: int
    """Processor time [s]."""
    wall_s: float
    """Wall-clock time [s]."""
    files: int = 32

    def exceeded(self, end: object) -> str:
        """Limit that ended a process with this exit code, in words; empty for another end."""
        if end == -signal.SIGKILL:
            return f"{self.memory_bytes / 1e9:g} GB of memory"
        return f"{self.cpu_s} s" if end in (-signal.SIGXCPU, -signal.SIGALRM) else ""


def confine(limits: ProcessLimits) -> None:
    """Limit this process permanently.

    The process is killed when its processor or wall-clock time is used up.  Allocations beyond the
    memory limit, opening more files and writing to any file fail.
    """
    for kind, most in (
        (resource.RLIMIT_AS, limits.memory_bytes),
        (resource.RLIMIT_NOFILE, limits.files),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(kind, (most, most))
    # SIGXCPU, which the parent can distinguish from a crash, comes 1 s before SIGKILL.
    resource.setrlimit(resource.RLIMIT_CPU, (limits.cpu_s, limits.cpu_s + 1))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, limits.wall_s)


def die_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent thread ends (Linux).

    If the parent has already ended, this process exits at once, because the kernel signals only
    later ends.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def prefer_as_victim() -> None:
    """Have the kernel kill this process before the server when memory runs out (Linux)."""
    try:
        Path("/proc/self/oom_score_adj").write_text("1000")
    except OSError:
        # Not Linux, or no permission: keep the default.
        return


def child_environment(temporary: Path) -> dict[str, str]:
    """Environment for a fork server: this process's without secrets, and one thread per library.

    Numerical libraries start their threads when they are loaded, and forking a process with threads
    is unsafe.
    """
    root = str(Path(__file__).parents[2])
    kept = {name: value for name, value in os.environ.items() if name not in _SECRETS}
    paths = [root, *filter(None, [kept.get("PYTHONPATH")])]
    return kept | {
        "PYTHONPATH": os.pathsep.join(paths),
        "TMPDIR": str(temporary),
        **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")},
    }


class Answers:
    """Messages of a task to its client."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe
        self._stage = ""
        self._sent = 0.0

    def send(self, message: dict[str, Any]) -> None:
        """Write a message; if the pipe has no reader any more, exit without an error."""
        line = json.dumps(message).encode() + b"\n"
        try:
            while line:
                line = line[os.write(self._pipe, line) :]
        except BrokenPipeError:
            # The client has ended or abandoned the task; the fork server would kill this child
            # anyway.
            os._exit(1)

    def progress(self, stage: str, fraction: float) -> None:
        """Write the stage and the completed fraction of the task, at most five times a second."""
        now = time.monotonic()
        if stage != self._stage or now - self._sent >= _PROGRESS_INTERVAL_S:
            self._stage, self._sent = stage, now
            self.send({"progress": {"stage": stage, "fraction": min(max(fraction, 0.0), 1.0)}})
