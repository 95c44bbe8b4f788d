"""Omitted terms bias the parameters; the intervals include that bias."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bench import EffectRequest, make_campaign
from identification.effects.electrical import BrushDrop
from identification.effects.friction import CoulombFriction
from identification.effects.sensor import ChannelDelay
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.model.excitation import records_of
from identification.posterior.density import Posterior
from identification.result.omitted import omitted_warnings, surrogate_warnings
from identification.selection.candidates import scales_of
from identification.selection.omitted import (
    OmittedTerm,
    consider_variances,
    omitted_terms,
    removal_steps,
    unknown_gain,
    with_omitted_drawn,
)
from identification.selection.refit import refitted_with, refitted_without
from identification.selection.screen import screened
from identification.selection.start import Along
from tests.effects.hidden import records_of_bench
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]
KINDS = (CoulombFriction, BrushDrop)


def detectable_terms(fit: Fit) -> tuple[OmittedTerm, ...]:
    """The two effect types whose predicted gain exceeds chance."""
    candidates = [c for kind in KINDS for c in kind.candidates(scales_of(fit))]
    tried = sum(candidate.prototypes for candidate in candidates)
    return omitted_terms(fit, effective_fraction(fit), screened(fit, candidates), tried)


@pytest.fixture(scope="module")
def clean() -> Fit:
    """Fit of a servo without hidden effects."""
    return fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=4)), "zoh")


@pytest.fixture(scope="module")
def rubbing() -> tuple[Fit, dict[str, float]]:
    """Servo with dry friction, fitted without it, and its true parameters."""
    hidden = make_campaign(
        "servo_150w", [EffectRequest(name="coulomb_friction")], seed=5, rows=1500
    )
    fit = fit_declared(records_of_bench(hidden).training, "zoh")
    return fit, hidden.truth["parameters"]


def test_clean_motor_omits_nothing(clean: Fit) -> None:
    """No predicted gain exceeds chance, so the draws stay unchanged."""
    posterior = Posterior(clean, effective_fraction(clean))
    draws = posterior.normal_draws(1, 50)

    assert detectable_terms(clean) == ()
    assert with_omitted_drawn(draws, clean, (), 1) is draws


def test_step_of_the_missing_term_leads_to_the_true_friction(
    rubbing: tuple[Fit, dict[str, float]],
) -> None:
    """Viscous friction has absorbed the dry friction; the step removes most of the error."""
    fit, truth = rubbing
    row = fit.coordinates.names.index("b")
    term = next(term for term in detectable_terms(fit) if term.name == "coulomb_friction")

    position = fit.position.copy()
    position[row] += term.steps["b"]
    stepped = fit.coordinates.values(position)[row]

    assert abs(stepped - truth["b"]) < 0.35 * abs(fit.values[row] - truth["b"])


def test_intervals_with_an_omitted_term_hold_the_true_parameters(
    rubbing: tuple[Fit, dict[str, float]],
) -> None:
    """By noise alone the interval of the friction is too narrow and misses the true value."""
    fit, truth = rubbing
    narrow = Posterior(fit, effective_fraction(fit)).normal_draws(1)
    wide = with_omitted_drawn(narrow, fit, detectable_terms(fit), 1)

    def holds(draws: dict[str, Array], name: str) -> bool:
        low, high = np.quantile(draws[name], [0.05, 0.95])
        return bool(low <= truth[name] <= high)

    assert not holds(narrow, "b")
    assert all(holds(wide, name) for name in ("Ra25", "Kt25", "J", "b"))


def test_draws_have_the_variance_that_is_considered(rubbing: tuple[Fit, dict[str, float]]) -> None:
    """Noise and omitted terms are independent, so their variances add."""
    fit, _ = rubbing
    omitted = detectable_terms(fit)
    narrow = Posterior(fit, effective_fraction(fit)).normal_draws(1, 20_000)
    wide = with_omitted_drawn(narrow, fit, omitted, 1)

    def variance(draws: dict[str, Array]) -> Array:
        values = np.stack([draws[name] for name in ("Ra25", "Kt25", "J")])
        return np.asarray(np.log(values).var(axis=1))

    rows = [fit.coordinates.names.index(name) for name in ("Ra25", "Kt25", "J")]
    expected = variance(narrow) + consider_variances(fit, omitted)[rows]
    np.testing.assert_allclose(variance(wide), expected, rtol=0.05)


def test_parameter_that_a_term_could_absorb_is_not_identified(clean: Fit) -> None:
    """A step by the whole value leaves no information in the data."""
    share = effective_fraction(clean)
    taken = (OmittedTerm("brush_drop", 100.0, 10.0, {"Ra25": 1.0}),)

    assert identified(clean, share)["Ra25"]
    assert not identified(clean, share, consider_variances(clean, taken))["Ra25"]


def test_unknown_gain_of_the_current_leaves_only_the_motor_constant(clean: Fit) -> None:
    """Two runs differ by a factor of two: Ra, L, J and b are known up to it, Kt exactly."""
    gain = unknown_gain(clean, [0.5, 1.0])
    share = effective_fraction(clean)

    known = identified(clean, share, consider_variances(clean, gain))
    draws = with_omitted_drawn(Posterior(clean, share).normal_draws(1, 20_000), clean, gain, 1)

    assert unknown_gain(clean, [1.0]) == ()
    assert [name for name in ("Ra25", "Kt25", "J", "b", "L") if known[name]] == ["Kt25"]
    np.testing.assert_allclose(draws["Ra25"] * draws["J"], np.prod(clean.values[[0, 4]]), rtol=0.05)
    assert np.log(draws["Ra25"]).std() == pytest.approx(np.log(2.0), rel=0.03)


def test_warning_names_the_terms_and_the_parameter_they_change_most(
    rubbing: tuple[Fit, dict[str, float]],
) -> None:
    """Dry friction is confounded with viscous friction, so b changes most."""
    fit, _ = rubbing

    (message,) = map(str, omitted_warnings(fit, detectable_terms(fit)))

    assert "none passes the acceptance criteria (coulomb_friction" in message
    assert "which is most for b: " in message


def test_no_terms_make_a_parameter_less_certain_than_its_prior(clean: Fit) -> None:
    """First-order steps of e^60 in L stay within the prior, which spans a factor of e^5."""
    far = [OmittedTerm(name, 20.0, 5.0, {"L": 60.0}) for name in ("brush_drop", "unlisted")]
    row = clean.coordinates.names.index("L")
    prior = clean.coordinates.prior_sd[row]
    assert consider_variances(clean, far)[row] == pytest.approx(prior**2)
    draws = {
        name: np.full(4000, at)
        for name, at in zip(clean.coordinates.names, clean.values, strict=True)
    }
    wide = np.log(with_omitted_drawn(draws, clean, far, seed=1)["L"] / clean.values[row])
    # The lower bound of L mirrors a part of the draws.
    assert 0.5 * prior < np.std(wide) < 1.05 * prior


def test_a_term_with_the_wrong_sign_changes_the_parameters_as_much_as_its_best_amplitude() -> None:
    """A voltage logged 3 % of a sample too early, where a delay is at least zero.

    A refit would start from the prototype, a delay of half a sample or more.
    """
    motor = motor_named("servo 100 W")
    early = [
        replace(run, voltage=0.97 * run.voltage + 0.03 * np.append(run.voltage[1:], 0.0))
        for run in campaign(motor, seed=4, noise=0.003)
    ]
    fit = fit_declared(records_of(early), "zoh")
    found = screened(fit, ChannelDelay.candidates(scales_of(fit)))
    voltage = [score for score in found if score.candidate.final.variant == "voltage"]

    (term,) = omitted_terms(fit, 1.0, voltage, 1)

    assert voltage[0].best < 0.0
    missed = np.log(motor.vector[-1] / fit.by_name["L"])
    assert term.steps["L"] == pytest.approx(missed, abs=0.5 * abs(missed))


def test_a_step_beyond_the_priors_is_reduced_for_all_parameters_together(
    rubbing: tuple[Fit, dict[str, float]],
) -> None:
    """Joint prior: the squares of all steps over their prior deviations sum to less than one.

    A thousandfold change per amplitude is no change of a linear model; its direction remains.
    """
    fit, _ = rubbing
    (score, *_) = screened(fit, CoulombFriction.candidates(scales_of(fit)))
    assert score.along is not None
    far = replace(score, along=Along(1e3 * score.along.position, score.along.states))

    (near,), (term,) = (omitted_terms(fit, 1.0, [one], 1) for one in (score, far))

    steps = [np.array([one.steps[name] for name in fit.coordinates.names]) for one in (near, term)]
    assert np.sum((steps[1] / fit.coordinates.prior_sd) ** 2) < 1.0
    np.testing.assert_allclose(
        steps[1] / np.linalg.norm(steps[1]), steps[0] / np.linalg.norm(steps[0])
    )
    np.testing.assert_allclose(steps[0], np.ravel(score.along.position), rtol=0.05)


def test_a_linear_change_of_a_positive_parameter_is_no_exponential(clean: Fit) -> None:
    """L (1 + 2 z) at z = 3 is seven times L; the exponential of 6 is 400."""
    term = OmittedTerm("channel_delay", 20.0, 5.0, {"L": 2.0}, is_linear=True)
    draws = {
        name: np.full(4000, at)
        for name, at in zip(clean.coordinates.names, clean.values, strict=True)
    }

    wide = with_omitted_drawn(draws, clean, [term], seed=1)["L"] / draws["L"]

    assert wide.min() > 0.0
    assert np.quantile(wide, 0.9987) == pytest.approx(7.0, rel=0.15)


def test_a_surrogate_changes_the_draws_in_which_it_is_one(clean: Fit) -> None:
    """A quarter of the draws, with the variance that is considered."""
    term = OmittedTerm("brush_drop", None, None, {"Ra25": 0.1}, surrogate=0.25)
    draws = {
        name: np.full(20_000, at)
        for name, at in zip(clean.coordinates.names, clean.values, strict=True)
    }

    change = np.log(with_omitted_drawn(draws, clean, [term], seed=1)["Ra25"] / draws["Ra25"])

    row = clean.coordinates.names.index("Ra25")
    assert np.mean(np.abs(change) > 1e-9) == pytest.approx(0.25, abs=0.01)
    assert np.var(change) == pytest.approx(consider_variances(clean, [term])[row], rel=0.05)


def test_removal_of_a_friction_returns_what_viscous_friction_absorbs(
    rubbing: tuple[Fit, dict[str, float]],
) -> None:
    """The change of b is that between two fits; a warning names it if the effect is improbable."""
    fit, _ = rubbing
    (score, *_) = screened(fit, CoulombFriction.candidates(scales_of(fit)))
    whole = refitted_with(fit, score.candidate.final, score.starts)

    removal = removal_steps(whole, refitted_without(whole, "coulomb_friction"))

    assert "coulomb_friction.torque" not in removal
    assert removal["b"] == pytest.approx(np.log(fit.by_name["b"] / whole.by_name["b"]), abs=0.02)
    surrogate = OmittedTerm("coulomb_friction", None, None, removal, surrogate=0.9)
    (message,) = map(str, surrogate_warnings(whole, [surrogate]))
    assert "coulomb_friction (10.0 %)" in message
    assert "change most for b: " in message
    assert surrogate_warnings(whole, [replace(surrogate, surrogate=0.1)]) == []
