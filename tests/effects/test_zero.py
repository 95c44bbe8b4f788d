"""Zero errors of the current sensor that differ from run to run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.zero import CurrentOffset, SpeedOffset, VoltageOffset
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from tests.effects.hidden import all_but
from tests.motors import campaign, motor_named

WITHHELD = all_but(
    "current_offset",
    "speed_offset",
    "voltage_offset",
    "load_torque",
    "coulomb_friction",
    "brush_drop",
)


def with_zeros(name: str, shares: tuple[float, ...], seed: int = 5) -> Campaign:
    """Three training runs and a validation run with current offsets, relative to the current."""
    clean = campaign(motor_named(name), seed=seed, runs=4, rows=800)
    size = float(np.sqrt(np.mean(clean[0].current ** 2)))
    runs = [
        replace(run, current=run.current + share * size)
        for run, share in zip(clean, shares, strict=True)
    ]
    return campaign_of(runs[:3], runs[3:])


def outcome_of(found: Campaign) -> Outcome:
    """Outcome of the search."""
    return search(fit_declared(found.training, "zoh"), found, withheld=WITHHELD)


@pytest.mark.parametrize("shares", [(0.03, -0.02, 0.05, -0.04), (0.02, 0.05, 0.06, 0.02)])
def test_zeros_that_differ_by_no_rule_are_offsets_of_each_run(shares: tuple[float, ...]) -> None:
    """True offsets of the runs; those of the second case are not linear in the run number."""
    found = with_zeros("servo 100 W", shares)

    outcome = outcome_of(found)

    assert [effect.name for effect in outcome.effects] == ["current_offset"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, CurrentOffset)
    assert term.variant == "separate value for each run"
    zeros = np.array([state[2] for state in outcome.fit.states])
    size = zeros[0] / shares[0]
    assert zeros == pytest.approx(size * np.array(shares[:3]), rel=0.05)


def test_one_zero_of_all_runs_stays_one_number() -> None:
    """An equal offset of all runs needs one parameter, the simpler law."""
    outcome = outcome_of(with_zeros("servo 100 W", (0.04,) * 4))

    assert [effect.name for effect in outcome.effects] == ["current_offset"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, CurrentOffset)
    assert term.variant == ""


def test_an_offset_of_each_run_comes_back_from_a_result() -> None:
    """Settings written before this law existed give the constant offset."""
    assert term_of(
        {"name": "current_offset", "settings": {"size": 2.0, "drifts": False, "own": True}}
    ) == CurrentOffset(2.0, own=True)
    assert term_of(
        {"name": "current_offset", "settings": {"size": 2.0, "drifts": False}}
    ) == CurrentOffset(2.0)


@pytest.mark.parametrize("kind", [CurrentOffset, SpeedOffset, VoltageOffset])
def test_a_zero_error_above_all_that_the_sensor_reads_is_another_law(
    kind: type[CurrentOffset | SpeedOffset | VoltageOffset],
) -> None:
    """A supply of 17 V RMS has no zero error of -154 V; a drifting one of 3 V is possible."""
    term = kind(17.0, drifts=True)

    assert term.flaw({"offset": -154.0, "drift": 0.3}).startswith("implausible: zero error 154 ")
    assert not term.flaw({"offset": -3.0, "drift": 0.3})
