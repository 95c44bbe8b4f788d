"""Fits that resume from a checkpoint after their process was killed."""

from __future__ import annotations

import time
from pathlib import Path

from tests.app.pretended import KEEPS
from tests.app.service import Caller, Server


def is_gone(path: Path) -> bool:
    """Return True if a path vanishes soon; files are removed just after the end of a fit."""
    deadline = time.monotonic() + 10
    while path.exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    return not path.exists()


def test_fit_resumes_from_the_checkpoint_of_earlier_attempts(
    alice: Caller, stored: str, server: Server
) -> None:
    """The mock fit counts attempts in its checkpoint and succeeds in the third."""
    fit = alice.wait(alice.begin(stored, seed=KEEPS)["id"])

    assert (fit["status"], fit["attempt"]) == ("succeeded", 3)
    assert fit["result"]["kept"] == 2
    assert is_gone(server.data_dir / "fits" / fit["id"] / "checkpoints")


def test_cancelled_fit_leaves_no_checkpoint(alice: Caller, stored: str, server: Server) -> None:
    """This holds for a running fit and for one that waits for its next attempt."""
    fit = alice.begin(stored, seed=KEEPS)["id"]
    kept = server.data_dir / "fits" / fit / "checkpoints"
    deadline = time.monotonic() + 10
    while not kept.exists() and alice.fit(fit)["status"] != "succeeded":
        assert time.monotonic() < deadline

    alice.http.delete(f"/fits/{fit}")

    assert is_gone(kept)
