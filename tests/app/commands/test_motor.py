"""Commands of one motor: where they find their files."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.commands.motor import campaign_runs

ROOT = Path(__file__).parents[3]


def test_campaigns_of_the_checkout_are_found_from_any_directory(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Without data/ in the working directory, those of the checkout are taken."""
    monkeypatch.chdir(tmp_path)

    training, validation = campaign_runs("paper_motor", None)

    folder = ROOT / "data" / "paper_motor"
    assert training == sorted(folder.glob("training_*.csv"))
    assert validation == sorted(folder.glob("validation_*.csv"))
