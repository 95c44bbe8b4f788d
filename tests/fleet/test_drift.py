"""Drift of parameters between two fits: known changes and false discoveries."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from identification.fleet.drift import FALSE_DISCOVERY_RATE, drift_of, drifts
from identification.fleet.refit import Estimate
from tests.fleet.fleets import estimate, fleet


def test_drift_is_the_difference_in_three_measures() -> None:
    """By hand: 1.1 - 1.0 = 0.1, relative 10 %, and 0.1 / sqrt(0.03^2 + 0.04^2) = 2."""
    drift = drift_of(estimate(1.1, 0.03), estimate(1.0, 0.04))

    assert drift is not None
    assert drift.absolute == pytest.approx(0.1)
    assert drift.relative == pytest.approx(0.1)
    assert drift.sds == pytest.approx(2.0)
    # Two-sided, from a table of the normal distribution.
    assert drift.probability == pytest.approx(0.0455, abs=1e-4)


def test_relative_drift_has_the_sign_of_the_change() -> None:
    """A coefficient that changes from -1.0e-3 to -1.1e-3 has fallen by a tenth of its magnitude."""
    drift = drift_of(estimate(-1.1e-3, 1e-5), estimate(-1.0e-3, 1e-5))

    assert drift is not None
    assert drift.relative == pytest.approx(-0.1)


@pytest.mark.parametrize(
    ("now", "before"),
    [
        (estimate(1.0, 0.1), None),
        (None, estimate(1.0, 0.1)),
        (estimate(1.0, 0.1, is_identified=False), estimate(1.0, 0.1)),
        (estimate(1.0, 0.1), estimate(1.0, 0.1, is_identified=False)),
        (Estimate(None, None, None, None, True), estimate(1.0, 0.1)),
    ],
)
def test_parameter_that_is_not_identified_has_no_drift(
    now: Estimate | None, before: Estimate | None
) -> None:
    """A median determined by the prior carries no information about the motor."""
    assert drift_of(now, before) is None


def test_estimates_without_spread_have_a_drift_and_no_probability() -> None:
    """With both standard deviations zero, no probability can be given."""
    drift = drift_of(estimate(2.0, 0.0), estimate(0.0, 0.0))

    assert drift is not None
    assert (drift.absolute, drift.relative, drift.sds, drift.probability) == (2.0, None, None, None)


@pytest.mark.parametrize("seed", range(10))
def test_fleet_that_has_not_changed_has_not_moved(seed: int) -> None:
    """Without any change, the false discovery rate is the probability of a flag: at most 5 %.

    For independent errors the Benjamini-Yekutieli correction is conservative by the factor sum(1/k)
    = 7.8 over 1400 comparisons, so ten fleets have no flag with a probability of 15/16.
    """
    found = drifts(fleet(200, seed))

    flagged = [drift for changes in found for drift in changes.values() if drift.is_significant]
    assert len(flagged) <= 1


def test_changes_that_happened_are_found_and_hardly_any_other() -> None:
    """Twenty changes of 6 % (8 combined standard deviations) among 1400 comparisons."""
    changed = {(number, "J"): 1.06 for number in range(20)}

    found = drifts(fleet(200, 3, changed))

    flagged = {(row, n) for row, c in enumerate(found) for n, d in c.items() if d.is_significant}
    assert flagged >= changed.keys()
    assert len(flagged - changed.keys()) <= 2


def test_correction_is_that_of_the_paper() -> None:
    """Reference: the step-up rule written out, largest k with p(k) <= k q / (m sum 1/i)."""
    refits = fleet(30, 5, {(n, "b"): 1.0 + 0.005 * n for n in range(30)})
    found = drifts(refits)
    raw = [
        (drift_of(r.estimates[n], r.previous.estimates[n]), d.is_significant)
        for r, changes in zip(refits, found, strict=True)
        for n, d in changes.items()
        if r.previous
    ]
    order = sorted((drift.probability, flag) for drift, flag in raw if drift and drift.sds)
    count = len(order)
    harmonic = sum(1.0 / k for k in range(1, count + 1))
    passing = [
        k
        for k, (p, _) in enumerate(order, start=1)
        if p is not None and p <= k * FALSE_DISCOVERY_RATE / (count * harmonic)
    ]

    assert [flag for _, flag in order] == [k <= max(passing) for k in range(1, count + 1)]
    assert 0 < max(passing) < count


def test_one_motor_needs_three_standard_deviations() -> None:
    """For seven comparisons, 0.05 / (7 * 2.593) is the two-sided tail beyond 2.99 sd."""
    refit = fleet(1, 1)[0]
    assert refit.previous is not None
    for sds, expected in ((2.9, False), (3.1, True)):
        still = {n: estimate(e.median or 0.0, 1e-6) for n, e in refit.estimates.items()}
        moved = still | {
            "Ra25": estimate((still["Ra25"].median or 0.0) + sds * math.sqrt(2) * 1e-6, 1e-6)
        }
        now = dataclasses.replace(
            refit, estimates=moved, previous=dataclasses.replace(refit.previous, estimates=still)
        )
        assert drifts([now])[0]["Ra25"].is_significant is expected


def test_motor_without_an_earlier_refit_has_no_drift() -> None:
    """A motor without an earlier fit does not enter the correction of the others."""
    refits = fleet(5, 2)
    alone = dataclasses.replace(refits[2], previous=None)

    found = drifts([*refits[:2], alone, *refits[3:]])

    assert found[2] == {}
    assert np.all([len(changes) == 7 for row, changes in enumerate(found) if row != 2])
