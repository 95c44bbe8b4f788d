"""Curves: smooth, and linear beyond the range of the data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from identification.fit.declared import fit_declared
from identification.model.excitation import records_of
from identification.model.term import Signals
from identification.selection.candidates import scales_of
from identification.surrogates.curve import HEIGHTS
from identification.surrogates.curves import MissingTorque, MissingVoltage
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def term() -> MissingTorque:
    """Curve over the speed, without removal of the collinear part."""
    fit = fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=4)), "zoh")
    for candidate in MissingTorque.candidates(scales_of(fit)):
        found = candidate.term
        if isinstance(found, MissingTorque) and (found.along, found.carrier) == ("speed", ""):
            return replace(found, removed=())
    raise AssertionError("no curve in the speed")


def basis(term: MissingTorque, speed: Array) -> Array:
    """Basis functions by the expressions that are simulated, (n_sample, n_height)."""
    w = ca.SX.sym("w")
    none = [ca.SX(0)] * 6
    signals = Signals(none[0], w, *none)
    function = ca.Function("b", [w], [ca.vertcat(*term.basis_of(term.along_of(signals, 0.0)))])
    found: Array = np.asarray(function(speed[None, :])).T
    return found


def speeds(term: MissingTorque, beyond: float) -> Array:
    """Speeds over the range of the data and beyond, equidistant in the plotted coordinate."""
    reach = term.upper - term.lower
    drawn = np.linspace(term.lower - beyond * reach, term.upper + beyond * reach, 900)
    return np.asarray(term.zero * np.sinh(drawn))


def test_heights_that_are_all_alike_are_a_constant_everywhere(
    term: MissingTorque,
) -> None:
    """This also holds beyond the ends."""
    np.testing.assert_allclose(basis(term, speeds(term, 0.3)).sum(axis=1), 1.0, atol=1e-12)


def test_beyond_its_ends_a_curve_keeps_its_slope(term: MissingTorque) -> None:
    """Second differences vanish in the plotted coordinate, without a jump."""
    found = basis(term, speeds(term, 0.3))

    bend = np.abs(np.diff(found, 2, axis=0)).max(axis=1)
    assert bend[:150].max() < 1e-9
    assert bend[-150:].max() < 1e-9
    assert bend.max() < 3e-3


def test_what_is_scored_is_what_is_simulated(term: MissingTorque) -> None:
    """Tables and expressions give the same basis, inside and outside the range of the data."""
    (record, *_) = records_of(campaign(motor_named("servo 100 W"), seed=4))
    speed = np.interp(np.arange(record.rows), np.linspace(0, record.rows, 900), speeds(term, 0.3))

    scored = term.columns(record, np.zeros(record.rows), speed)

    np.testing.assert_allclose(scored, basis(term, speed), atol=1e-5)


def test_the_removed_line_is_a_spline_and_its_coefficients_have_no_effect() -> None:
    """A straight line is formed by the heights, so that its removal leaves no remainder.

    The remainder of a line that is only approximated would be another basis function, which has
    heights of a thousand times its values and diverges beyond the data.
    """
    fit = fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=4)), "zoh")
    terms = [c.term for c in MissingTorque.candidates(scales_of(fit))]
    (own,) = [t for t in terms if isinstance(t, MissingTorque) and t.along == "speed"]
    ((line, amount),) = own.removed
    speed = speeds(own, 0.0)
    rng = np.random.default_rng(7)
    heights = rng.standard_normal(HEIGHTS)

    formed = basis(own, speed) @ np.array(line)
    slope = formed @ speed / (speed @ speed)

    assert np.abs(formed - slope * speed).max() < 0.02 * np.abs(formed).max()
    assert np.dot(line, amount) == pytest.approx(1.0)
    np.testing.assert_allclose(own.kept @ np.array(line), 0.0, atol=1e-9 * np.abs(line).max())
    np.testing.assert_allclose(
        own.kept @ (heights + 100.0 * np.array(line)), own.kept @ heights, atol=1e-6
    )


def test_a_curve_over_the_load_is_one_over_the_torque_of_the_motor() -> None:
    """A magnet that is 50 K warmer makes less torque of the same current, and less friction."""
    fit = fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=4)), "zoh")
    terms = [c.term for c in MissingTorque.candidates(scales_of(fit))]
    (load,) = [t for t in terms if isinstance(t, MissingTorque) and "size" in t.along]
    current, alpha = ca.SX.sym("current"), -0.002
    others = [ca.SX(0)] * 7

    def drawn(heat: float, value: float) -> float:
        signals = replace(Signals(current, *others), temperature=ca.SX(25.0 + heat))
        return float(ca.Function("z", [current], [load.along_of(signals, alpha)])(value))

    assert load.drivers == ("current", "speed")
    assert drawn(50.0, 10.0 / 0.9) == pytest.approx(drawn(0.0, 10.0))
    assert drawn(50.0, 10.0) < drawn(0.0, 10.0)


def lost_voltage(motor_voltage: Callable[[Array], Array]) -> str:
    """Objection to the curve of what a stage with this characteristic loses, from -12 to 12 V."""
    zero, most = 1.8, 12.0
    end = float(np.arcsinh(most / zero))
    term = MissingVoltage("voltage", "", 8.0, -end, end, zero, speed=100.0, current=1.0)
    logged: Array = zero * np.sinh(np.linspace(-end, end, 400))
    bases = np.column_stack([term.over_signal(height)[1] for height in np.eye(HEIGHTS)])
    at = np.linspace(0, len(bases) - 1, logged.size).astype(int)
    heights = np.linalg.lstsq(bases[at], logged - motor_voltage(logged), rcond=None)[0]
    return term.flaw({f"height_{k + 1}": height for k, height in enumerate(heights)})


@pytest.mark.parametrize("dead", [0.5, 2.0])
def test_a_stage_with_a_dead_zone_is_plausible(dead: float) -> None:
    """The voltage of the motor stays at zero and then rises; so does that of a saturated stage."""
    assert lost_voltage(lambda v: np.sign(v) * np.maximum(np.abs(v) - dead, 0.0)) == ""
    assert lost_voltage(lambda v: np.clip(v, -6.0, 6.0)) == ""


def test_a_motor_voltage_that_falls_while_the_logged_one_rises_is_implausible() -> None:
    """A sawtooth over two levels is what replaces Ra25 and Kt25 behind a soft source."""
    flaw = lost_voltage(lambda v: v - 5.0 * np.sin(v))

    assert "the logged one rises" in flaw
    assert "% of the range" in flaw
