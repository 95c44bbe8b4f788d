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


def test_a_fit_without_the_search_for_effects_is_no_measure_of_change() -> None:
    """The second fit has another torque constant, because it has no effects; the third has not."""
    third, second, first = _fits(1.0)
    (other,) = fleet(1, 7, {(0, "Kt25"): 0.9})
    plain = dataclasses.replace(second, estimates=other.estimates, is_searched=False)
    fits = [third, plain, first]

    rows = history_view(fits, {fit.fit: "2026-11-01T00:00:00+00:00" for fit in fits})["rows"]

    assert rows["second"]["previous"] == ""
    assert rows["third"]["previous"] == "first"
    assert rows["second"]["changed"] == rows["third"]["changed"] == ""


def _fits(factor: float) -> list[Refit]:
    """Three fits of one motor, newest first; only the newest has another torque constant."""
    (changed,) = fleet(1, 7, {(0, "Kt25"): factor})
    assert changed.previous is not None
    return [
        dataclasses.replace(changed, fit="third", previous=None),
        dataclasses.replace(changed.previous, fit="second"),
        dataclasses.replace(changed.previous, fit="first"),
    ]
