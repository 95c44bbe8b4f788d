"""The nominal-model fit of the bench determines the detectability of an effect."""

from __future__ import annotations

import pytest

from bench import EffectRequest, make_campaign
from bench.declared import fit_declared
from bench.visibility import held_out_rise, size_for_rise


@pytest.mark.parametrize("motor", ["coreless_10w", "paper_motor", "traction_10kw", 5])
def test_clean_campaign_is_explained_to_its_noise(motor: str | int) -> None:
    """The noise ratio is 1 with a scatter of 1 / sqrt(2 n), and the parameter errors are small."""
    fit = fit_declared(make_campaign(motor, seed=3, rows=3000))

    for role in ("training", "validation"):
        assert list(fit.ratios[role].values()) == pytest.approx([1.0, 1.0], abs=0.03)
    assert abs(fit.shift["Ra25"]) < 0.01
    assert abs(fit.shift["Kt25"]) < 0.01
    assert abs(fit.shift["J"]) < 0.01


def test_linear_hold_is_explained_when_it_is_declared() -> None:
    """The error equals the noise with FOH declared and is far above with ZOH."""
    right = fit_declared(make_campaign("servo_150w", seed=3, rows=2000, hold="foh"))
    wrong = fit_declared(make_campaign("servo_150w", ["input_hold"], seed=3, rows=2000))

    assert right.held_out == pytest.approx(1.0, abs=0.03)
    assert wrong.held_out > 2.0


def test_brush_drop_is_partly_absorbed_by_the_resistance() -> None:
    """A voltage with the sign of the current raises the fitted Ra and leaves a residual."""
    fit = fit_declared(make_campaign("servo_150w", [("brush_drop", 0.03)], seed=3, rows=3000))

    assert fit.shift["Ra25"] > 0.02
    assert fit.held_out > 2.0


def test_rise_without_noise_predicts_the_rise_with_noise() -> None:
    """The residual of a noise-free fit and the noise add in squares."""
    effects = [("coulomb_friction", 0.012)]

    foretold = held_out_rise("servo_150w", effects, seed=3, rows=3000)
    measured = fit_declared(make_campaign("servo_150w", effects, seed=3, rows=3000)).held_out - 1.0

    assert foretold == pytest.approx(measured, abs=0.03)
    assert foretold > 0.1


@pytest.mark.parametrize("name", ["coulomb_friction", "flux_saturation", "channel_delay"])
def test_size_is_found_for_a_target_rise(name: str) -> None:
    """The rise of the returned size is the target rise."""
    size = size_for_rise("wiper_60w", name, 0.15, seed=3, rows=2000)

    assert size is not None
    rise = held_out_rise("wiper_60w", [EffectRequest(name, size)], seed=3, rows=2000)
    assert rise == pytest.approx(0.15, rel=0.2)


def test_undetectable_effect_has_no_size() -> None:
    """Slow sampling does not detect a saturation of the inductance of any size."""
    assert size_for_rise("coreless_10w", "inductance_saturation", 0.3, seed=3, rows=600) is None
