"""Plot of one parameter of a motor over its fits."""

from __future__ import annotations

import re
from dataclasses import replace

from identification.fleet.drift import drifts
from identification.fleet.figure import history_figure
from identification.fleet.refit import Estimate, Refit, compared_with

SD = 0.01


def fit(median: float, is_identified: bool = True) -> Refit:
    """Fit with this resistance, whose standard deviation is 0.01 ohm."""
    ends = (median - 1.645 * SD, median + 1.645 * SD)
    estimate = Estimate(median, SD, *ends, is_identified)
    return Refit("motor", "succeeded", {"Ra25": estimate})


def drawn(*fits: Refit) -> str:
    """The plot of the fits, oldest first."""
    chain = [compared_with(one, before) for one, before in zip(fits, [None, *fits], strict=False)]
    times = [f"20{number:02d}-11-01T21:00:00Z" for number in range(len(fits))]
    return history_figure("Ra25", chain, drifts(chain), times)


def places(figure: str, kind: str) -> list[float]:
    """Horizontal coordinates of the intervals of one kind."""
    drawn = re.findall(f'<path class="{kind}" d="([^"]+)"', figure)
    return [float(x) for path in drawn for x in re.findall(r"M(\S+) ", path)]


def test_only_the_fit_after_a_change_is_highlighted() -> None:
    """A step of 0.2 ohm is 14 combined standard deviations; a step of 0.01 ohm is 0.7."""
    figure = drawn(fit(1.0), fit(1.01), fit(1.21), fit(1.21))

    first, second, third = places(figure, "stem")
    (changed,) = places(figure, "stem loud")
    assert first < second < changed < third


def test_fit_that_does_not_identify_the_parameter_is_left_out() -> None:
    """Its place remains empty; the description counts the other fits."""
    figure = drawn(fit(1.0), fit(5.0, is_identified=False), fit(1.0))

    assert len(places(figure, "stem")) == 2
    assert "2 fits, from 1.000 to 1.000 ohm" in figure


def test_parameter_that_no_fit_identifies_has_no_plot() -> None:
    """The page leaves it out."""
    assert drawn(fit(1.0, is_identified=False)) == ""
    assert drawn(replace(fit(1.0), estimates={})) == ""


def test_few_labels_are_drawn_for_many_fits() -> None:
    """Forty fits have at most five labels, the first one included."""
    figure = drawn(*(fit(1.0) for _ in range(40)))

    labels = re.findall(r'data-time="([^"]+)"[^>]*>([^<]+)<', figure)
    assert labels[0] == ("2000-11-01T21:00:00Z", "2000-11-01")
    assert 3 <= len(labels) <= 5


def test_tick_labels_leave_room_for_the_label_of_the_axis() -> None:
    """A value of seven digits with a tight interval has labels of nine characters."""
    tight = Estimate(1.0998123, 1e-7, 1.0998121, 1.0998125, True)
    figure = drawn(Refit("motor", "succeeded", {"Ra25": tight}))

    labels = re.findall(r'<text class="tick end" x="([\d.]+)"[^>]*>([^<]+)<', figure)
    assert max(len(label) for _, label in labels) >= 8
    assert all(float(x) - 9.0 * len(label) > 22.0 for x, label in labels)
