"""Motors that stand out from the fleet, by a rule that outliers do not shift."""

from __future__ import annotations

import dataclasses

import pytest

from identification.fleet.outliers import spread_of
from identification.fleet.refit import Refit
from tests.fleet.fleets import CENTRE, TOLERANCE, estimate, fleet


def other(refits: list[Refit], place: int, name: str, value: float, sd: float) -> list[Refit]:
    """Fleet with one parameter of one motor replaced."""
    changed = dataclasses.replace(
        refits[place], estimates={**refits[place].estimates, name: estimate(value, sd)}
    )
    return [*refits[:place], changed, *refits[place + 1 :]]


@pytest.mark.parametrize("name", CENTRE)
def test_spread_is_that_of_the_fleet(name: str) -> None:
    """400 motors with 3 % tolerance and 0.5 % errors; the robust scale is accurate to 6 %."""
    spread = spread_of(name, fleet(400, 1))

    assert spread.count == 400
    assert spread.median == pytest.approx(CENTRE[name], rel=0.01)
    assert spread.relative_scale == pytest.approx(TOLERANCE, rel=0.15)


def test_outlying_motor_has_its_distance_in_robust_standard_deviations() -> None:
    """A resistance of 1.3 times the centre has the distance ln 1.3 / 0.03 = 8.7."""
    spread = spread_of("Ra25", other(fleet(100, 2), 17, "Ra25", 1.3 * CENTRE["Ra25"], 1e-3))

    assert [place for place in range(100) if spread.is_outlier(place)] == [17]
    assert spread.scores[17] == pytest.approx(8.7, rel=0.2)


def test_motor_that_was_measured_badly_does_not_stand_out() -> None:
    """The same value with a relative standard deviation of 1/3 is no evidence."""
    refits = other(fleet(100, 2), 17, "Ra25", 1.3 * CENTRE["Ra25"], 0.3 * CENTRE["Ra25"])

    assert not spread_of("Ra25", refits).is_outlier(17)


def test_forty_outliers_of_a_hundred_do_not_mask_each_other() -> None:
    """The breakdown point of a median is 50 %; mean and variance would fail here."""
    refits = fleet(100, 4)
    for place in range(25):
        refits = other(refits, place, "J", 3.0 * CENTRE["J"], 1e-8)

    spread = spread_of("J", refits)

    assert all(spread.is_outlier(place) for place in range(25))


@pytest.mark.parametrize(("count", "is_odd"), [(4, False), (5, True)])
def test_few_motors_are_no_fleet(count: int, is_odd: bool) -> None:
    """At least five motors are needed to call one of them an outlier."""
    refits = other(fleet(count, 6), 0, "L", 10.0, 1e-3)

    assert spread_of("L", refits).is_outlier(0) is is_odd


def test_fleet_of_equals_has_no_outlier_and_no_division_by_zero() -> None:
    """All medians are equal, so every distance is zero."""
    refits = fleet(6, 7)
    for place in range(6):
        refits = other(refits, place, "b", 2e-5, 0.0)

    spread = spread_of("b", refits)

    assert spread.scores == (None,) * 6
    assert not any(spread.is_outlier(place) for place in range(6))


def test_undetermined_and_failed_motors_are_left_out() -> None:
    """These motors have no score and do not enter the median."""
    refits = fleet(9, 8)
    hidden = dataclasses.replace(
        refits[0], estimates={"J": estimate(1.0, 1.0, is_identified=False)}
    )
    failed = Refit("bad", "failed", error="no such file")

    spread = spread_of("J", [hidden, failed, *refits[1:]])

    assert (spread.count, spread.scores[:2]) == (8, (None, None))
    assert spread_of("J", [failed]).median is None
