"""Time, memory and effective samples of one measurement, reported by its own process as JSON."""

from __future__ import annotations

import json
import os
import resource
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["TARGET", "Stopwatch", "ess_min", "limit_memory", "peak_mb", "posterior_line", "report"]

Array = NDArray[np.float64]

TARGET = 1000.0
"""Smallest bulk effective sample size over the parameters at which a sampler stops."""


class Stopwatch:
    """Seconds of wall and of processor by label, summed over repeated use, and the peak memory.

    The diagnostics need ArviZ, whose memory is not that of a sampler; the peak is that before its
    import.
    """

    def __init__(self) -> None:
        self.wall: dict[str, float] = {}
        self.cpu: dict[str, float] = {}
        self.peak_mb = 0.0

    @contextmanager
    def timed(self, label: str) -> Iterator[None]:
        """Add the time of the block to a label."""
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            self.wall[label] = self.wall.get(label, 0.0) + time.perf_counter() - wall
            self.cpu[label] = self.cpu.get(label, 0.0) + time.process_time() - cpu
            if "arviz" not in sys.modules:
                self.peak_mb = peak_mb()

    def line(self) -> dict[str, Any]:
        """Entries of the log."""
        return {"wall": self.wall, "cpu": self.cpu, "peak_mb": self.peak_mb}


def peak_mb() -> float:
    """Largest resident memory of this process until now [MB]."""
    unit = 1024.0 if sys.platform.startswith("linux") else 1024.0**2
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def limit_memory() -> None:
    """Let an allocation beyond the memory of the machine fail, instead of exhausting it."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    resource.setrlimit(resource.RLIMIT_DATA, (physical * 9 // 10, resource.RLIM_INFINITY))


def ess_min(chain: Array) -> float:
    """Smallest bulk effective sample size over the dimensions, by ArviZ.

    Args:
        chain: (n_step, n_chain, n_dim).
    """
    return float(np.min(_by_dimension(chain, "ess")))


def _by_dimension(chain: Array, what: str) -> list[float]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the coming version of ArviZ
        import arviz  # noqa: PLC0415  its memory is not that of the measurement

        function = getattr(arviz, what)
        method = "bulk" if what == "ess" else "rank"
        return [
            float(function(np.ascontiguousarray(chain[:, :, k].T), method=method))
            for k in range(chain.shape[2])
        ]


def posterior_line(watch: Stopwatch, chain: Array, kept: float) -> dict[str, Any]:
    """Entries of the log of a sampler.

    Args:
        watch: Times, with the label ``sampling`` of all steps after the warm-up and, if the sampler
            has any, ``warm-up``.
        chain: (n_step, n_chain, 9) physical values after warm-up and burn-in.
        kept: Fraction of the sampling time after the burn-in.
    """
    ess = _by_dimension(chain, "ess")
    flat = chain.reshape(-1, chain.shape[2])
    rates = {}
    for name, spent in (("wall", watch.wall), ("cpu", watch.cpu)):
        rates[f"ess_per_{name}_s"] = min(ess) / (spent["sampling"] * kept)
        rates[f"ess_per_{name}_s_with_warm_up"] = min(ess) / (
            spent["sampling"] + spent.get("warm-up", 0.0)
        )
    return {
        **watch.line(),
        **rates,
        "ess": ess,
        "r_hat": max(_by_dimension(chain, "rhat")),
        "draws": flat.shape[0],
        "mean": flat.mean(axis=0).tolist(),
        "sd": flat.std(axis=0, ddof=1).tolist(),
    }


def report(line: dict[str, Any], versions: Sequence[str]) -> None:
    """Print the line with the versions of packages, for the parent process."""
    from importlib.metadata import version  # noqa: PLC0415  not part of the measurement

    line["versions"] = {name: version(name) for name in versions}
    print(json.dumps(line))
