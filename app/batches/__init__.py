"""Batches of the HTTP service: one request for many motors, with one fit each.

A batch is stored in one transaction.  SQLite blocks all other writers meanwhile: other workspaces,
and the server that renews the leases of running fits.  Clients therefore split larger batches.
"""

from __future__ import annotations

from typing import Final

__all__ = ["MOST_MOTORS", "MOST_RUNS"]

MOST_MOTORS: Final = 1000
"""Maximum number of motors in a batch."""

MOST_RUNS: Final = 10_000
"""Maximum number of runs in a batch; a run counts once for each motor that names it.

With these limits the write lock is held for about 1 s at most; the lease of a running
fit lasts 15 s.
"""
