"""Fits whose process dies and that go on from what they had."""

from __future__ import annotations

import time
from pathlib import Path

from tests.app.pretended import KEEPS
from tests.app.service import Caller, Server


def is_gone(path: Path) -> bool:
    """Whether a path vanishes, which it does just after the fit's end is told."""
    deadline = time.monotonic() + 10
    while path.exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    return not path.exists()


def test_fit_goes_on_from_the_checkpoint_of_the_attempts_before(
    alice: Caller, stored: str, server: Server
) -> None:
    """It counts in its checkpoint, dies twice, and the third attempt says 2."""
    fit = alice.wait(alice.begin(stored, seed=KEEPS)["id"])

    assert (fit["status"], fit["attempt"]) == ("succeeded", 3)
    assert fit["result"]["kept"] == 2
    assert is_gone(server.data_dir / "fits" / fit["id"] / "checkpoints")


def test_cancelled_fit_leaves_no_checkpoint(alice: Caller, stored: str, server: Server) -> None:
    """Whether it runs or waits for its next attempt at that moment."""
    fit = alice.begin(stored, seed=KEEPS)["id"]
    kept = server.data_dir / "fits" / fit / "checkpoints"
    deadline = time.monotonic() + 10
    while not kept.exists() and alice.fit(fit)["status"] != "succeeded":
        assert time.monotonic() < deadline

    alice.http.delete(f"/fits/{fit}")

    assert is_gone(kept)
