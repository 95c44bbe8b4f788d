"""Controllers given as text."""

from __future__ import annotations

import pytest

from identification.errors import OptionError
from identification.feedback import Controller, parse_controller, parse_controllers


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("P:1", Controller("P:1", 1.0)),
        ("PI:2,0.5", Controller("PI:2,0.5", 2.0, 0.5)),
        ("PID:2,0.5,1e-3", Controller("PID:2,0.5,1e-3", 2.0, 0.5, 1e-3)),
        (" pid : 2 , 0 , 0 ", Controller("pid : 2 , 0 , 0", 2.0)),
        ("P:-1", Controller("P:-1", -1.0)),
    ],
)
def test_controller_is_read_with_its_gains(text: str, expected: Controller) -> None:
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

    assert "expected P:kp, PI:kp,ki or PID:kp,ki,kd" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_no_controller_at_all_is_refused() -> None:
    """An empty list of controllers gives no result."""
    with pytest.raises(OptionError, match="no controller given"):
        parse_controllers([])
