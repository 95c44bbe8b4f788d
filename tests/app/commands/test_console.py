"""Tables of a fit on the console."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from app.commands.console import print_fit, print_rows
from tests.reports import make_report


def test_parameters_of_one_name_belong_to_their_effects(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Friction and a load both have a torque, each below its effect."""
    result = copy.deepcopy(dict(make_report(with_effect=True).result))
    load = result["effects"][0] | {"name": "load_torque"}
    result["effects"] = [result["effects"][0], load]

    print_fit(result, Path("out"))

    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    for name in ("coulomb_friction", "load_torque"):
        assert lines[lines.index(name) + 1].startswith("  torque ")


def test_parameter_that_the_runs_do_not_determine_is_a_dash(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The median of such a parameter is a typical value, as the page of a fleet knows."""
    row = {"motor": "a", "Ra25": 1.12868, "Ra25_identified": True}
    row |= {"alpha_Ra": 0.0034062, "alpha_Ra_identified": False}

    print_rows(["motor", "Ra25", "alpha_Ra"], [row])

    assert capsys.readouterr().out.splitlines()[-1].split() == ["a", "1.1287", "–"]
