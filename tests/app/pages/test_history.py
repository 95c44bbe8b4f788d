"""View of the fits of one motor over time."""

from __future__ import annotations

import dataclasses

from app.pages.analysis_views import history_view
from identification.fleet.refit import Refit
from tests.fleet.fleets import fleet


def test_history_names_the_probable_cause_of_a_change() -> None:
    """Of three fits, only the last has another torque constant: the magnets have lost flux."""
    fits = _fits(0.9)

    rows = history_view(fits, {fit.fit: "2026-11-01T00:00:00+00:00" for fit in fits})["rows"]

    first, second, third = (rows[fit.fit] for fit in reversed(fits))
    assert "% demagnetization" in third["causes"]
    assert third["changed"] == "Kt25"
    assert first["causes"] == second["causes"] == ""


def _fits(factor: float) -> list[Refit]:
    """Three fits of one motor, newest first; only the newest has another torque constant."""
    (changed,) = fleet(1, 7, {(0, "Kt25"): factor})
    assert changed.previous is not None
    return [
        dataclasses.replace(changed, fit="third", previous=None),
        dataclasses.replace(changed.previous, fit="second"),
        dataclasses.replace(changed.previous, fit="first"),
    ]
