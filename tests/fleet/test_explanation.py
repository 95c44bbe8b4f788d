"""Probable causes of a change between two campaigns: physics of the directions, and statistics."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from benchmarks.simulated_fleet import simulated_fleet
from identification import Run
from identification.fleet.causes import CAUSES, Cause
from identification.fleet.explanation import UNDECIDED, Explanation, explanations
from identification.fleet.page import render_fleet
from identification.fleet.refit import Refit, Size, compared_with, refit_of
from identification.fleet.table import rows_of
from identification.options import FitOptions
from identification.pipeline import identify
from tests.fleet.fleets import CENTRE, ERROR, estimate
from tests.motors import campaign, motor_named

BY_NAME = {cause.name: cause for cause in CAUSES}
BENCH = ("current_gain", "voltage_gain", "speed_gain")


def changed(relative: Mapping[str, float], sd: float = ERROR, **more: float) -> Refit:
    """One motor, refitted after relative changes; no errors, independent estimates."""
    fits = []
    for moment in range(2):
        values = {
            name: value * (1.0 + relative.get(name, 0.0) * moment) for name, value in CENTRE.items()
        }
        sizes = {
            name: Size(estimate(1.0 + value * moment, sd), "", "") for name, value in more.items()
        }
        fits.append(
            Refit(
                "m",
                "fitted",
                {name: estimate(value, sd * abs(value)) for name, value in values.items()},
                sizes={name.replace("__", "."): size for name, size in sizes.items()},
                correlation={(name, name): 1.0 for name in CENTRE},
            )
        )
    return compared_with(fits[1], fits[0])


def explained(refit: Refit) -> Explanation:
    """Explanation of a fleet of one motor."""
    (found,) = explanations([refit])
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("relative", "cause"),
    [
        ({"Kt25": -0.08}, "demagnetization"),
        ({"Ra25": 0.08, "alpha_Ra": -0.08}, "brush_wear"),
        ({"Ra25": -0.08, "alpha_Ra": 0.08}, "better_contact"),
        ({"b": -0.2}, "run_in"),
        ({"J": 0.1}, "load_inertia"),
        ({"Ra25": -0.05, "Kt25": -0.05, "L": -0.1}, "shorted_turns"),
        ({"alpha_Ra": 0.1, "alpha_Kt": 0.1}, "thermometer"),
    ],
)
def test_change_is_explained_by_its_cause(relative: dict[str, float], cause: str) -> None:
    """Each change is what the physics of the cause predicts, ten standard deviations large."""
    found = explained(changed(relative))

    assert found.is_significant
    assert found.cause == cause
    for name, value in relative.items():
        assert found.changes[name] == pytest.approx(value, rel=0.15)


def test_rise_of_the_torque_constant_is_no_demagnetization() -> None:
    """Flux is lost, not gained: the sign belongs to the cause."""
    found = explained(changed({"Kt25": 0.08}))

    assert found.is_significant
    assert found.causes["demagnetization"] < 1e-6


def test_change_that_no_cause_has_is_unlisted() -> None:
    """Ra25 and J rise by different sizes while L falls: no single cause of the list does so."""
    assert explained(changed({"Ra25": 0.1, "J": 0.05, "L": -0.2, "Kt25": 0.1})).cause == "unlisted"


def test_friction_without_a_separate_coulomb_term_is_undecided() -> None:
    """A larger b alone may be grease or bearings; both are listed and none is chosen."""
    found = explained(changed({"b": 0.3}))

    assert found.cause == UNDECIDED
    assert set(found.likely) >= {"grease", "bearing_wear"}
    with_coulomb = explained(changed({"b": 0.3}, coulomb_friction__torque=0.0))
    assert with_coulomb.cause == "grease"
    worn = explained(changed({}, coulomb_friction__torque=0.3))
    assert worn.cause == "bearing_wear"


@pytest.mark.parametrize("name", BENCH)
def test_gain_of_a_channel_changes_the_parameters_as_its_direction_says(name: str) -> None:
    """Independent reference: the same runs with one channel scaled by 1.05, fitted again."""
    channel = name.partition("_")[0]
    runs = campaign(motor_named("servo 100 W"), seed=3)
    scaled = [_scaled(run, channel) for run in runs]
    options = FitOptions(effects=False, posterior=False)
    before, after = (
        refit_of("m", "", identify(some, (), options).result) for some in (runs, scaled)
    )

    found = explained(compared_with(after, before))

    assert found.cause == name
    direction = BY_NAME[name].directions({})[0]
    for parameter, share in direction.items():
        if parameter in found.compared:
            assert _ratio(after, before, parameter) == pytest.approx(1.05**share, rel=0.01)


def _scaled(run: Run, channel: str) -> Run:
    changes: dict[str, Any] = {channel: 1.05 * np.asarray(getattr(run, channel))}
    return dataclasses.replace(run, **changes)


def _ratio(after: Refit, before: Refit, name: str) -> float:
    now, then = after.estimates[name].median, before.estimates[name].median
    assert now
    assert then
    return now / then


def test_unchanged_fleets_hardly_raise_an_alarm() -> None:
    """The false discovery rate of fleets without any drift is the fraction of fleets with alarms.

    Twenty fleets of fifty motors with correlated errors: 5 % allow one; three have a probability
    below 8 % even at that limit, which the procedure of Benjamini and Yekutieli does not exhaust.
    """
    rng = np.random.default_rng(5)

    alarmed = [
        any(one and one.is_significant for one in explanations(simulated_fleet(50, rng, {})))
        for _ in range(20)
    ]

    assert sum(alarmed) <= 2


@pytest.mark.parametrize("cause", CAUSES, ids=lambda cause: cause.name)
def test_cause_is_named_or_listed_for_large_changes(cause: Cause) -> None:
    """20 motors changed by 10 % (friction 50 %) along the cause: five combined sd or more."""
    rng = np.random.default_rng(6)
    found = explanations(simulated_fleet(20, rng, dict.fromkeys(range(20), (cause, 0.1))))

    named = [one for one in found if one and one.cause == cause.name]
    assert len(named) >= 16


def test_correlated_errors_are_no_change() -> None:
    """Errors of 3 sd in Kt25 and J, correlated by 0.95, are one rare error and not two.

    With the correlation the squared distance is 9.2 of 7 degrees of freedom, p = 0.24 before the
    repeatability; opposite errors of 3 sd would be impossible.
    """
    same, opposite = (
        changed({"Kt25": 0.042, "J": 0.042}, 0.01),
        changed({"Kt25": 0.042, "J": -0.042}, 0.01),
    )
    correlation = {(n, n): 1.0 for n in CENTRE} | {("Kt25", "J"): 0.95, ("J", "Kt25"): 0.95}

    known = [
        dataclasses.replace(
            refit,
            correlation=correlation,
            previous=refit.previous
            and dataclasses.replace(refit.previous, correlation=correlation),
        )
        for refit in (same, opposite)
    ]

    assert [explained(refit).is_significant for refit in known] == [False, True]


def test_results_without_correlations_are_tested_by_the_largest_change() -> None:
    """Bonferroni: one change of z sd among seven has p = 7 erfc(z / sqrt 2)."""
    refit = changed({"J": 0.03}, 0.01)
    assert refit.previous is not None
    old = dataclasses.replace(
        refit, correlation={}, previous=dataclasses.replace(refit.previous, correlation={})
    )

    # ln 1.03 over sqrt(2 * 0.01^2 + 0.002^2) is 2.07 sd, two-sided p = 0.0384.
    assert explained(old).probability == pytest.approx(7 * 0.0384, rel=0.03)


def test_parameters_of_differing_effects_are_not_compared() -> None:
    """If one model has friction and the other not, b is another parameter; Ra25 is the same."""
    refit = changed({"Ra25": 0.08, "alpha_Ra": -0.08, "b": -0.5})

    found = explained(dataclasses.replace(refit, equations={"coulomb_friction": "mechanical"}))

    assert set(found.compared) == {"Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "L"}
    assert found.differing == ("coulomb_friction",)
    assert found.cause == "brush_wear"
    sensor = dataclasses.replace(refit, equations={"channel_delay": "sensor"})
    assert explained(sensor).compared == ()
    assert not explained(sensor).is_significant


def test_table_and_page_name_the_cause() -> None:
    """The row has name, probability and alternatives; the page also says what to check."""
    refit = changed({"Kt25": -0.08})

    (row,) = rows_of([refit])
    page = render_fleet("Refit", [refit])

    assert row["drift_cause"] == "demagnetization"
    assert row["drift_significant"] is True
    assert row["drift_causes"].startswith("demagnetization:")
    assert row["drift_cause_probability"] > 0.9
    assert "the magnets have lost flux" in page
    assert "overcurrent and overheating" in page
    first = dataclasses.replace(refit, previous=None)
    assert rows_of([first])[0]["drift_cause"] is None
