"""Curves that are collinear with nominal parameters: the shared direction is non-identifiable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bench import EffectRequest, make_campaign
from identification.effects.friction import CoulombFriction
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.model.excitation import records_of
from identification.model.simulate import Simulator
from identification.posterior.density import Posterior
from identification.result.omitted import confounded_warnings
from identification.selection.candidates import scales_of
from identification.selection.non_identifiable import (
    collinear_sizes,
    linear_parts_of,
    with_linear_parts,
    with_linear_parts_drawn,
)
from identification.selection.omitted import consider_variances
from identification.selection.refit import refined, refitted_with
from identification.selection.start import Start
from identification.surrogates.curve import AbstractCurve
from identification.surrogates.curves import collinear, is_formed, sampled
from tests.effects.hidden import records_of_bench
from tests.motors import campaign, motor_named
from tests.selection.curved import with_curve

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def declared() -> Fit:
    """Fit of a servo without hidden effects."""
    return fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=4)), "zoh")


@pytest.mark.parametrize(
    ("along", "carrier", "equation", "signal"),
    [
        ("speed", "", "mechanical", "speed"),
        ("current", "", "mechanical", "current"),
        ("current", "", "electrical", "current"),
        ("voltage", "", "electrical", "voltage"),
        ("time", "current", "electrical", "current"),
    ],
)
def test_a_line_moves_parameters_and_not_the_motor(
    declared: Fit, along: str, carrier: str, equation: str, signal: str
) -> None:
    """Simulated with the line and without, every draw does the same.

    A torque constant has no line's temperature coefficient, so that there it is nearly the same.
    """
    closed = with_curve(declared, along, carrier, equation)
    (term,) = closed.simulator.model.terms
    assert isinstance(term, AbstractCurve)
    own = {"speed": closed.values[5] * term.speed, "voltage": term.size}
    own["current"] = closed.values[0 if equation == "electrical" else 2] * term.current
    widths = [0.3 * own[name] * (name == signal) for name in ("current", "speed", "voltage")]
    model = replace(closed.simulator.model, terms=(replace(term, linear=tuple(widths)),))
    before = {
        name: np.full(6, value)
        for name, value in zip(closed.coordinates.names, closed.values, strict=True)
    }
    opened = Simulator(model, closed.simulator.records, closed.simulator.plan)
    fit = replace(closed, simulator=opened)

    after = with_linear_parts_drawn(before, linear_parts_of(fit), seed=1)

    values = np.array([after[p.name] for p in model.parameters])
    assert np.ptp(values[:7], axis=1).max() > 0.0
    bare = closed.simulator.logged(closed.values[:, None], closed.states)
    for alone, lines, record in zip(
        bare, opened.logged(values, closed.states), opened.records, strict=True
    ):
        tolerance = 0.02 if (equation, signal) == ("mechanical", "current") else 1e-4
        assert np.all(np.abs(lines - alone).max(axis=(0, 2)) < tolerance * record.span)


def test_a_parameter_that_a_curve_cannot_form_stays_in_it() -> None:
    """Cubic splines form a straight line; steps do not, however well they correlate."""
    x = np.linspace(-1.0, 1.0, 401)
    smooth = np.column_stack([x**k for k in range(4)])
    steps = np.column_stack([np.sign(x), np.abs(x), x**2])

    assert is_formed(smooth, x)
    assert not is_formed(steps, x)
    (line,), (amount,) = (
        part.T if part.shape[1] == 1 else part for part in collinear(smooth, x[:, None])
    )
    np.testing.assert_allclose(line / line[1], [0, 1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(amount / amount[1], [0, 1, 0, 0.6], atol=0.01)
    assert line @ amount == pytest.approx(1.0)
    assert collinear(steps, x[:, None])[0].size == 0


def test_of_two_signals_only_the_combination_that_is_formed_is_taken() -> None:
    """Functions of the sum of two signals remove the sum and leave the difference."""
    rng = np.random.default_rng(1)
    one, other = rng.standard_normal((2, 5000))
    basis = np.column_stack([one + other, (one + other) ** 3])

    lines, amounts = collinear(basis, np.column_stack([one, other]))

    kept = basis - basis @ lines @ amounts
    assert lines.shape == (2, 1)
    np.testing.assert_allclose(kept[:, 0], 0.0, atol=1e-9)
    assert abs(np.corrcoef(kept[:, 1], one - other)[0, 1]) < 0.05


@pytest.mark.parametrize(
    ("effect", "along", "carrier", "equation", "open_"),
    [
        (EffectRequest("square_voltage_loss", 0.05), "current", "", "electrical", "Ra25"),
        (EffectRequest("rub_above_speed", 0.1), "speed", "", "mechanical", "b"),
        (EffectRequest("load_dependent_friction", 0.1), "size of torque", "direction",
         "mechanical", ""),
    ],
)  # fmt: skip
def test_parameters_of_a_model_with_a_curve_are_correct_or_not_identified(
    effect: EffectRequest, along: str, carrier: str, equation: str, open_: str
) -> None:
    """Without the line, resistance or friction was off by hundreds of its standard deviations.

    A spline is not the law itself, so that a hundredth is allowed.
    """
    measured = make_campaign("servo_150w", [effect], seed=31, rows=1200, training=4, validation=1)
    declared = fit_declared(records_of_bench(measured).training, "zoh")
    closed = refined(with_curve(declared, along, carrier, equation))

    final = with_linear_parts(closed)

    known = identified(final, effective_fraction(closed))
    assert [name for name in final.coordinates.names[:7] if not known[name]] == (
        {"Ra25": ["Ra25", "alpha_Ra"], "b": ["b"], "": []}[open_]
    )
    draws = Posterior(closed, effective_fraction(closed)).normal_draws(seed=3)
    draws = with_linear_parts_drawn(draws, linear_parts_of(final), seed=3)
    for name, value in measured.truth["parameters"].items():
        off = abs(draws[name].mean() - value)
        assert off < max(4.0 * draws[name].std(), 0.01 * abs(value)), name


def with_friction(curve: EffectRequest, along: str, carrier: str) -> tuple[Fit, float]:
    """Fit of a curve and a Coulomb friction to a motor that has both, and its torque [N m]."""
    hidden = [curve, EffectRequest("coulomb_friction", 0.2)]
    measured = make_campaign("servo_150w", hidden, seed=31, rows=1200, training=4, validation=1)
    declared = fit_declared(records_of_bench(measured).training, "zoh")
    closed = with_curve(declared, along, carrier, "mechanical")
    (candidate,) = CoulombFriction.candidates(scales_of(closed))
    start = candidate.starts[:, 0]
    found = refined(refitted_with(closed, candidate.term, [Start(start)]))
    torque = measured.truth["effects"][1]["values"]["torque"]
    return found, torque


def test_a_friction_that_a_curve_contains_is_not_identified_and_their_sum_is() -> None:
    """A constant friction is the sum of all splines over the load, times the sign of the speed."""
    fit, torque = with_friction(
        EffectRequest("load_dependent_friction", 0.1), "size of torque", "direction"
    )

    (found,) = collinear_sizes(fit)

    name = "coulomb_friction.torque"
    fraction = effective_fraction(fit)
    added = consider_variances(fit, [found])
    assert found.parameter == name
    assert identified(fit, fraction)[name]
    assert not identified(fit, fraction, added)[name]
    (warning,) = confounded_warnings(fit, fraction, [found])
    assert "torque of Coulomb friction is collinear with the curve over mag" in warning.message
    at = fit.coordinates.names.index(name)
    assert (
        abs(fit.values[at] - torque)
        < 2.0 * found.steps[name] * fit.coordinates.slopes(fit.position)[at]
    )
    moved = np.array([found.steps.get(key, 0.0) for key in fit.coordinates.names])
    alone = np.where(np.arange(moved.size) == at, moved, 0.0)
    together, single = (
        np.concatenate(
            fit.simulator.logged(fit.coordinates.values(fit.position + step)[:, None], fit.states)
        )[:, :, 0] - np.concatenate(fit.simulated())
        for step in (moved, alone)
    )  # fmt: skip
    assert np.linalg.norm(together) < 0.05 * np.linalg.norm(single)


def test_a_friction_that_a_curve_cannot_form_stays_identified() -> None:
    """A curve in the speed is smooth where the friction changes its sign."""
    fit, torque = with_friction(EffectRequest("rub_above_speed", 0.1), "speed", "")

    assert collinear_sizes(fit) == ()
    assert fit.by_name["coulomb_friction.torque"] == pytest.approx(torque, rel=0.1)


@pytest.mark.parametrize(
    ("along", "equation", "place"),
    [("current", "electrical", 0), ("speed", "mechanical", 1), ("voltage", "electrical", 2)],
)
def test_a_curve_contains_no_line_in_its_own_signal(
    declared: Fit, along: str, equation: str, place: int
) -> None:
    """Else the fit shares a line between curve and parameters by their priors alone."""
    (term,) = with_curve(declared, along, "", equation).simulator.model.terms
    assert isinstance(term, AbstractCurve)

    columns, regressors = sampled(term, declared.simulator.records)

    cosines = regressors[:, place] @ columns / np.linalg.norm(regressors[:, place])
    # A spline forms a line in the compressed signal to a thousandth.
    assert np.all(np.abs(cosines) < 3e-3 * np.linalg.norm(columns, axis=0).max())
