"""Friction and brush drops that differ from run to run, as those of brushes that run in."""

from __future__ import annotations

import pytest

from bench import make_campaign
from benchmarks.coverage import run_of
from identification.effects.effect import AbstractEffect, effects_of
from identification.effects.electrical import BrushDrop
from identification.effects.friction import CoulombFriction
from identification.effects.runs import EACH_RUN
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.result.run_values import run_values
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from tests.effects.hidden import all_but

WITHHELD = all_but(
    "coulomb_friction",
    "stribeck_friction",
    "brush_drop",
    "load_torque",
    "current_offset",
    "voltage_offset",
)
MOTOR = "servo_150w"


def with_sizes(name: str, sizes: tuple[float, ...]) -> tuple[Campaign, list[float]]:
    """Campaign whose last run is for validation, and the first value of the effect in each run.

    The simulated bench has the effect in another size in each run, relative to the rated values.
    """
    effects = [[(name, size)] for size in sizes]
    made = [
        make_campaign(MOTOR, effect, seed=k, rows=800, training=1)
        for k, effect in enumerate(effects)
    ]
    runs = [run_of(each.training[0], f"{k}.csv") for k, each in enumerate(made)]
    values = [next(iter(each.truth["effects"][0]["values"].values())) for each in made]
    return campaign_of(runs[:-1], runs[-1:]), values


def outcome_of(found: Campaign) -> tuple[Outcome, AbstractEffect]:
    """Outcome of the search, and its only effect."""
    outcome = search(fit_declared(found.training, "zoh"), found, withheld=WITHHELD)
    (term,) = effects_of(outcome.fit.simulator.model.terms)
    return outcome, term


@pytest.mark.parametrize(
    ("name", "parameter", "sizes"),
    [
        ("coulomb_friction", "torque", (0.08, 0.06, 0.03, 0.05)),
        ("brush_drop", "voltage", (0.03, 0.05, 0.06, 0.04)),
    ],
)
def test_another_size_in_each_run_is_a_size_of_each_run(
    name: str, parameter: str, sizes: tuple[float, ...]
) -> None:
    """The true size of each run is known; no run has that of another one."""
    found, values = with_sizes(name, sizes)

    outcome, term = outcome_of(found)

    assert (term.name, term.variant) == (name, EACH_RUN)
    mean = outcome.fit.by_name[f"{name}.{parameter}"]
    for entry, value in zip(run_values(term, outcome.fit, 1.0), values, strict=False):
        assert mean + entry["values"]["excess"]["median"] == pytest.approx(value, rel=0.04)


@pytest.mark.parametrize("name", ["coulomb_friction", "brush_drop"])
def test_one_size_in_all_runs_stays_one_number(name: str) -> None:
    """An equal size in all runs needs one parameter, the simpler law."""
    found, _ = with_sizes(name, (0.05,) * 4)

    _, term = outcome_of(found)

    assert (term.name, term.variant) == (name, "")


def test_an_excess_of_each_run_comes_back_from_a_result() -> None:
    """Settings written before these laws existed give one size for all runs."""
    settings = {"torque_size": 2.0, "width": 0.1}
    each = {**settings, "several": True, "spread": 0.3}

    friction = CoulombFriction(2.0, 0.1, several=True, spread=0.3)
    assert term_of({"name": "coulomb_friction", "settings": each}) == friction
    assert term_of({"name": "coulomb_friction", "settings": settings}) == CoulombFriction(2.0, 0.1)
    sizes = {"voltage_size": 10.0, "current_size": 1.0}
    assert term_of({"name": "brush_drop", "settings": sizes}) == BrushDrop(10.0, 1.0)


@pytest.mark.parametrize(("spread", "is_implausible"), [(0.3, False), (2.1, True), (0.0, False)])
def test_sizes_that_would_be_negative_in_some_runs_are_implausible(
    spread: float, is_implausible: bool
) -> None:
    """A friction whose differences exceed its mean stands in for another law."""
    friction = CoulombFriction(2.0, 0.1, several=True, spread=0.3)

    flaw = friction.flaw({"torque": 2.0, "asymmetry": 0.0, "spread": spread})

    assert bool(flaw) is is_implausible
