"""Constant loads: one for all runs, and another weight in each run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.load import LoadTorque
from identification.effects.runs import EACH_RUN
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.result.run_values import run_values
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, run_of

MOTOR = motor_named("servo 100 W")
ROWS, NOISE = 1500, 0.005


def loaded(torque: float, rng: np.random.Generator) -> Run:
    """A run at 25 degC with a constant load torque [N m].

    The equations with a load are those without, at a current lower by T / Kt and a voltage lower by
    Ra T / Kt.
    """
    resistance, constant = MOTOR.values[0], MOTOR.values[2]
    holding = torque / constant
    voltage = drive(MOTOR, "steps", ROWS, rng)
    free = run_of(MOTOR, voltage - resistance * holding, np.full(ROWS, 25.0), np.zeros(2))
    current, speed = free.current + holding, free.speed
    return replace(
        free,
        voltage=voltage,
        current=current + NOISE * current.std() * rng.standard_normal(ROWS),
        speed=speed + NOISE * speed.std() * rng.standard_normal(ROWS),
    )


def with_loads(shares: tuple[float, ...]) -> tuple[Campaign, list[float]]:
    """Campaign whose last run is for validation, and its loads [N m].

    The loads are relative to the stall torque of the motor.
    """
    rng = np.random.default_rng(7)
    stall = MOTOR.voltage / MOTOR.values[0] * MOTOR.values[2]
    torques = [share * stall for share in shares]
    runs = [loaded(torque, rng) for torque in torques]
    return campaign_of(runs[:-1], runs[-1:]), torques


WITHHELD = all_but(
    "load_torque", "load_step", "coulomb_friction", "stribeck_friction", "current_offset"
)


def outcome_of(found: Campaign) -> Outcome:
    """Outcome of the search."""
    return search(fit_declared(found.training, "zoh"), found, withheld=WITHHELD)


def test_another_weight_in_each_run_is_a_load_of_each_run() -> None:
    """No run, not the validation run either, has the load of another one."""
    found, torques = with_loads((0.0, 0.05, 0.15, 0.1))

    outcome = outcome_of(found)

    assert [effect.name for effect in outcome.effects] == ["load_torque"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, LoadTorque)
    assert term.variant == EACH_RUN
    loads = [state[2] for state in outcome.fit.states]
    assert loads == pytest.approx(torques[:-1], abs=0.01 * max(torques))
    entries = run_values(term, outcome.fit, 1.0)
    assert [entry["file"] for entry in entries] == [r.name for r in outcome.fit.simulator.records]
    for entry, torque in zip(entries, torques, strict=False):
        value = entry["values"]["torque"]
        assert value["median"] == pytest.approx(torque, abs=5.0 * value["sd"])
        assert value["identified"]
    values = outcome.fit.by_name
    assert values["Kt25"] == pytest.approx(MOTOR.values[2], rel=0.005)
    assert values["b"] == pytest.approx(MOTOR.values[5], rel=0.1)


def test_one_weight_in_all_runs_stays_one_number() -> None:
    """An equal load of all runs needs one parameter, the simpler law."""
    found, torques = with_loads((0.1,) * 4)

    outcome = outcome_of(found)

    assert [effect.name for effect in outcome.effects] == ["load_torque"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, LoadTorque)
    assert term.variant == ""
    assert outcome.fit.by_name["load_torque.torque"] == pytest.approx(torques[0], rel=0.02)


def test_a_load_of_each_run_comes_back_from_a_result() -> None:
    """Settings written before this law existed give the constant load."""
    settings = {"torque_size": 2.0}

    each = term_of({"name": "load_torque", "settings": {**settings, "own": True}})
    assert each == LoadTorque(2.0, own=True)
    assert term_of({"name": "load_torque", "settings": settings}) == LoadTorque(2.0)
