"""Limits that a process puts on itself before it touches what a stranger sent.

Used by the processes that read uploads and those that compute fits; nothing here can be undone
by the process that called it.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Limits", "child_environment", "confine", "die_with_parent", "prefer_as_victim"]

_PR_SET_PDEATHSIG = 1
_SECRETS = ("MOTORID_DATABASE_URL", "PGPASSWORD")


@dataclass(frozen=True)
class Limits:
    """How much a process may use.

    Args:
        memory_bytes: Address space [bytes].
        cpu_s: Processor time [s].
        wall_s: Time [s].
        files: Open files.
    """

    memory_bytes: int
    cpu_s: int
    wall_s: float
    files: int = 32


def confine(limits: Limits) -> None:
    """Bound this process for good: it may write no file, and ends when it exceeds a limit."""
    for kind, most in (
        (resource.RLIMIT_AS, limits.memory_bytes),
        (resource.RLIMIT_NOFILE, limits.files),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(kind, (most, most))
    # One second between the signal that can be told from a crash and the one that cannot be caught.
    resource.setrlimit(resource.RLIMIT_CPU, (limits.cpu_s, limits.cpu_s + 1))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, limits.wall_s)


def die_with_parent(parent: int) -> None:
    """Have the kernel end this process when the thread that started it ends.

    Args:
        parent: Process that started this one; if it is gone already, this process ends here, since
            the kernel tells only of what happens after it was asked.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def prefer_as_victim() -> None:
    """Have the kernel end this process before the server where memory runs out."""
    try:
        Path("/proc/self/oom_score_adj").write_text("1000")
    except OSError:
        # Not Linux, or not allowed: the machine's own choice stands.
        return


def child_environment(temporary: Path) -> dict[str, str]:
    """Environment of a process that forks others: this one's without secrets, and one thread.

    Numerical libraries start their threads when they are loaded, and a process with threads cannot
    be forked soundly.

    Args:
        temporary: Where it may put temporary files.
    """
    root = str(Path(__file__).parents[1])
    kept = {name: value for name, value in os.environ.items() if name not in _SECRETS}
    paths = [root, *filter(None, [kept.get("PYTHONPATH")])]
    return kept | {
        "PYTHONPATH": os.pathsep.join(paths),
        "TMPDIR": str(temporary),
        **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")},
    }
