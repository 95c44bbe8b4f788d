"""Second inertia behind a springy shaft or backlash: action equals reaction."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from bench import make_campaign
from identification.effects.inertia import InertiaChange
from identification.effects.load import AbstractSecondInertia, ShaftCompliance
from identification.fit.declared import fit_declared
from identification.model.composite import INPUTS, MotorModel
from identification.model.term import Signals, Values
from identification.selection.search import search
from identification.surrogates.laws import Backlash
from tests.effects.hidden import all_but, records_of_bench

SHAFT = ShaftCompliance(1.0, 10.0, 1e4)
LOOSE = Backlash(10.0, 1e4, 1e-6, 1.0)
VALUES = Values(J=2e-5, share=0.3, resonance=400.0, damping=0.2, hardening=0.0, play=1e-7)
"""Physical values; the play is a ten-thousandth of the twists below."""
SIGNALS = [field.name for field in fields(Signals)]


@pytest.mark.parametrize("term", [SHAFT, LOOSE], ids=["shaft", "play"])
def test_the_joint_neither_makes_nor_takes_momentum(term: AbstractSecondInertia) -> None:
    """The rotor loses the momentum that the second inertia gains: tau = -J_2 dw_2/dt."""
    for twist, slip in ((1e-3, 0.0), (0.0, 0.5), (-2e-3, 0.3)):
        rotor = VALUES.J * (1 - VALUES.share)
        signals = Signals(
            **(dict.fromkeys(SIGNALS, 0.0) | {"speed": 100.0 + slip, "inertia": rotor})
        )
        states = Values(twist=twist, speed=100.0)

        sliding, pulled = (float(rate) for rate in term.rates(signals, states, VALUES))
        torque = float(term.torque(signals, states, VALUES))

        assert sliding == pytest.approx(slip)
        assert torque == pytest.approx(-VALUES.share * VALUES.J * pulled)
        assert float(term.factor(signals, states, VALUES)) + VALUES.share == 1.0


def test_another_inertia_changes_both_sides_of_a_shaft_and_not_its_stiffness() -> None:
    """The same run of a motor with the larger inertia and, at its stiffness, lower resonance.

    The two agree to rounding.
    """
    change, run = 0.4, 2
    values = {
        "Ra25": 1.0, "alpha_Ra": 0.004, "Kt25": 0.05, "alpha_Kt": -0.001, "J": 2e-5, "b": 1e-5,
        "L": 1e-3, "share": 0.3, "resonance": 400.0, "damping": 0.2, "hardening": 0.05,
    }  # fmt: skip
    slower = np.sqrt(1 + change)
    heavy = values | {
        "J": values["J"] * (1 + change),
        "resonance": values["resonance"] / slower,
        "damping": values["damping"] / slower,
    }
    inputs = dict.fromkeys(INPUTS, 0.0) | {"voltage": 12.0, "temperature": 25.0, "run": float(run)}
    state = [3.0, 100.0, 2e-3, 90.0]

    changed = MotorModel((SHAFT, InertiaChange(run))).rates(
        state, [*inputs.values()], [*values.values(), change]
    )
    same = MotorModel((SHAFT,)).rates(state, [*inputs.values()], [*heavy.values()])

    np.testing.assert_allclose(np.array(changed), np.array(same), rtol=1e-12)


def test_a_part_with_hardly_any_play_moves_as_one_behind_a_springy_shaft() -> None:
    """Backlash with its rounding is 1e-4 of the twist; so is the difference."""
    twists, slips = np.meshgrid([-3e-3, -1e-3, 1e-3, 5e-3], [-0.5, 0.0, 0.5])

    for twist, slip in zip(twists.flat, slips.flat, strict=True):
        stiff, loose = (float(term.pull(twist, slip, VALUES)) for term in (SHAFT, LOOSE))
        assert loose == pytest.approx(stiff, abs=2e-4 * 400.0**2 * 1e-3)


def test_within_the_play_nothing_is_pulled() -> None:
    """At a tenth of the backlash from its centre the rounding leaves a few thousandths."""
    wide = Values(**(vars(VALUES) | {"play": 0.1}))

    free, met = (float(LOOSE.pull(twist, 0.0, wide)) for twist in (0.01, 0.06))

    assert abs(free) < 0.005 * 0.1 * 400.0**2
    assert met == pytest.approx(400.0**2 * 0.01, rel=0.2)


WITHHELD = all_but(
    "shaft_compliance", "channel_delay", "speed_filter", "coulomb_friction", "cogging_torque"
)


def test_a_springy_shaft_is_not_called_backlash() -> None:
    """The unlisted backlash law can describe the same motion and is not selected."""
    measured = make_campaign(
        "servo_150w", ["shaft_compliance"], seed=16, rows=1500, training=3, validation=1
    )
    campaign = records_of_bench(measured)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)

    assert [found.name for found in outcome.effects] == ["shaft_compliance"]


def test_a_joint_that_cannot_oscillate_is_no_elastic_shaft() -> None:
    """Above critical damping it only delays, like a fluid coupling, and would stand for any lag."""
    damping = next(p for p in SHAFT.parameters if p.name == "damping")

    assert damping.upper == pytest.approx(1.0)
