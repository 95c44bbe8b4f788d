"""Controllers given as text."""

from __future__ import annotations

import pytest

from identification.errors import OptionError
from identification.speed_loop import (
    AbstractController,
    TransferFunction,
    parse_controller,
    parse_controllers,
)
from identification.speed_loop.controller import PID


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("P:1", PID("P:1", 1.0)),
        ("PI:2,0.5", PID("PI:2,0.5", 2.0, 0.5)),
        ("PID:2,0.5,1e-3", PID("PID:2,0.5,1e-3", 2.0, 0.5, 1e-3)),
        (" pid : 2 , 0 , 0 ", PID("pid : 2 , 0 , 0", 2.0, 0.0, 0.0)),
        ("P:-1", PID("P:-1", -1.0)),
    ],
)
def test_controller_is_read_with_its_gains(text: str, expected: AbstractController) -> None:
    """The gains are in the order kp, ki, kd."""
    assert parse_controller(text) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "controller '' is of unknown type"),
        ("P", "is of unknown type"),
        ("PD:1,2", "'PD:1,2' is of unknown type"),
        ("1", "is of unknown type"),
        ("P:", "the gain '', which is not a number"),
        ("P:1,2", "has 2 gains; P requires 1"),
        ("PI:1", "has 1 gain; PI requires 2"),
        ("PID:1,2", "has 2 gains; PID requires 3"),
        ("PI:1,x", "the gain 'x', which is not a number"),
        ("P:1_0", "the gain '1_0', which is not a number"),
        ("P:\u0661", "the gain '\u0661', which is not a number"),
        ("PI:1,\uff12", "the gain '\uff12', which is not a number"),
        ("P:nan", "the gain 'nan'; a gain must be finite"),
        ("P:inf", "the gain 'inf'; a gain must be finite"),
        ("P:1e13", "the gain '1e13'; a gain must be finite and at most 1e12"),
        ("PID:0,0,0", "has only zero gains"),
        ("Q" * 5000, r"QQQ\.\.\.' is of unknown type"),
        ("P\n:1;rm", r"'P\\n:1;rm' has the gain"),
    ],
)
def test_invalid_controller_is_refused_with_the_accepted_forms(text: str, message: str) -> None:
    """Each message is one line and ends with the accepted forms."""
    with pytest.raises(OptionError, match=message) as caught:
        parse_controller(text)

    assert "expected P:kp, PI:kp,ki, PI+FF:kp,ki,kff or PID:kp,ki,kd" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_no_controller_at_all_is_refused() -> None:
    """An empty list of controllers gives no result."""
    with pytest.raises(OptionError, match="no controller given"):
        parse_controllers([])


@pytest.mark.parametrize(
    ("numerator", "denominator", "message"),
    [
        ((1.0, float("nan")), (1.0,), "not finite"),
        ((1.0,), (float("inf"), 1.0), "not finite"),
        ((1.0,), (0.0, 1.0), r"denominator=\(0.0, 1.0\).* begins with 0"),
        ((1.0,), (), "begins with 0"),
        ((1.0, 2.0, 3.0), (1.0,), "differentiates more than once"),
    ],
)
def test_transfer_function_that_no_loop_can_use_is_refused(
    numerator: tuple[float, ...], denominator: tuple[float, ...], message: str
) -> None:
    """Each with its coefficients: the loop with the motor must be finite and strictly proper."""
    with pytest.raises(OptionError, match=message):
        TransferFunction(numerator, denominator)


def test_controller_object_passes_where_a_text_is_parsed() -> None:
    """A controller of one's own needs no specification text."""
    own = PID("tuned", 2.0, 0.5)

    assert parse_controllers([own, "P:1"]) == [own, PID("P:1", 1.0)]
