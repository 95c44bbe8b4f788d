"""Fleet page: content, escaping, and no external requests."""

from __future__ import annotations

import dataclasses
import re

import pytest

from identification.fleet.page import content_security_policy, render_fleet
from identification.fleet.refit import Refit
from tests.fleet.fleets import CENTRE, estimate, fleet


def page(refits: list[Refit]) -> str:
    """Fleet page as text."""
    return render_fleet("Refit", refits)


def test_every_motor_is_in_every_plot() -> None:
    """Each motor has a tooltip in each parameter plot and a row in the last table."""
    text = page(fleet(12))

    assert text.count('<rect class="hover"') == 12 * len(CENTRE)
    assert len(re.findall(r'<tr><th scope="row">motor \d+ <span class="tag', text)) == 12
    assert text.count("<svg") == len(CENTRE)


def test_motors_are_in_the_order_of_their_medians() -> None:
    """The tooltips of the first plot (Ra25) are in ascending order of the median."""
    refits = fleet(12)
    expected = sorted(refits, key=lambda refit: refit.estimates["Ra25"].median or 0.0)

    told = re.findall(r"<title>(motor \d+): ", page(refits).partition("Ra25 over the fleet")[2])

    assert told[:12] == [refit.motor for refit in expected]


def test_outlying_and_drifting_motors_are_listed_and_highlighted() -> None:
    """Motor 3 has twice the usual inertia; motor 5 lost a tenth of its torque constant."""
    refits = fleet(30, 1, {(5, "Kt25"): 0.9})
    odd = dataclasses.replace(
        refits[3], estimates={**refits[3].estimates, "J": estimate(2 * CENTRE["J"], 1e-8)},
        previous=None,
    )  # fmt: skip
    text = page([*refits[:3], odd, *refits[4:]])

    summary = text.partition('id="Ra25"')[0]
    assert re.search(r'motor 3</th><td><a href="#J">J</a>', summary)
    assert re.search(r'motor 5</th><td><a href="#Kt25">Kt25</a>.*?−\d+ %', summary, re.S)
    assert 'class="stem loud"' in text


def test_fleet_over_decades_is_drawn_on_a_logarithmic_axis() -> None:
    """From 0.01 to 100 ohm the ticks are powers of ten; the median deviation is a factor of 10."""
    refits = [
        dataclasses.replace(r, estimates={"Ra25": estimate(10.0 ** (n - 2), 1e-4)}, previous=None)
        for n, r in enumerate(fleet(5))
    ]

    text = page(refits)
    ticks = re.findall(r'<text class="tick end"[^>]*>([^<]+)</text>', text)

    assert {"0.01", "0.1", "1", "10", "100"} <= set(ticks)
    assert "half of the motors are more than a factor of 10 away" in text
    assert "robust standard deviation 9" not in text


@pytest.mark.parametrize(
    "refits",
    [
        [],
        [Refit("m", "failed", error="no such file")],
        fleet(1),
        [dataclasses.replace(fleet(1)[0], previous=None)],
        [Refit("m", "fitted", estimates={"b": estimate(0.0, 0.0)})],
        [Refit("m", "fitted", estimates={"alpha_Ra": estimate(-1e-3, 0.0)})] * 3,
    ],
    ids=["nothing", "failed", "one", "first", "zero", "equal"],
)
def test_poor_fleets_have_a_page(refits: list[Refit]) -> None:
    """Fleets without motors, results or spread give a page without NaN."""
    text = page(refits)

    assert text.rstrip().endswith("</html>")
    assert not re.search(r"\b(nan|inf)\b|>None<|None [^b]", text.partition("<body>")[2])


def test_page_holds_names_as_text_and_no_address_of_another() -> None:
    """Markup in a name or reason is escaped; the policy allows only the styles of the page."""
    evil = '"><script>alert(1)</script>'
    refits = [dataclasses.replace(r, motor=evil) for r in fleet(6)]
    text = page([*refits, Refit(evil, "failed", error=evil)])

    assert "<script" not in text
    assert not re.search(r"(?:src|href)=\"(?!#|data:,)", text)
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org", "")
    assert "script" not in content_security_policy()
    assert content_security_policy().startswith("default-src 'none'; style-src 'sha256-")


def test_first_warning_of_a_motor_is_in_its_row() -> None:
    """The first warning is escaped and followed by the number of warnings."""
    refits = fleet(2)
    warned = dataclasses.replace(refits[0], warnings=("Kt25 <7> by --known", "a gap"))

    text = page([warned, refits[1]])

    assert text.count("2 warnings: Kt25 &lt;7&gt; by --known") == 1
    assert "0 warnings" not in text
