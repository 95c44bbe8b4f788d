"""Curves: smooth, and linear beyond the range of the data."""

from __future__ import annotations

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
from identification.surrogates.curves import MissingTorque
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def term() -> MissingTorque:
    """Curve over the speed, without removal of the collinear part."""
    fit = fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=4)), "zoh")
    for candidate in MissingTorque.candidates(scales_of(fit)):
        found = candidate.term
        if isinstance(found, MissingTorque) and (found.along, found.carrier) == ("speed", ""):
            return replace(found, imitated=((0.0, 0.0),) * HEIGHTS)
    raise AssertionError("no curve in the speed")


def basis(term: MissingTorque, speed: Array) -> Array:
    """Basis functions by the expressions that are simulated, (n_sample, n_height)."""
    w = ca.SX.sym("w")
    none = [ca.SX(0)] * 6
    signals = Signals(none[0], w, *none)
    function = ca.Function("b", [w], [ca.vertcat(*term.basis_of(term.along_of(signals)))])
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
