"""How large a batch may be; what makes batches of more cuts them at these numbers.

A batch is kept in one transaction, and SQLite lets nobody else write meanwhile: not another
workspace, and not the server that renews the leases of the fits that run.
"""

from __future__ import annotations

from typing import Final

__all__ = ["MOST_MOTORS", "MOST_RUNS"]

MOST_MOTORS: Final = 1000
"""Motors of one batch."""

MOST_RUNS: Final = 10_000
"""Runs of all motors of one batch together, each as often as a motor names it.

With these the writer is held for about a second at most, where the lease of a running fit lasts 15.
"""
