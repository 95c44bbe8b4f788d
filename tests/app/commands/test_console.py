"""Tables of a fit on the console."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from app.commands.console import print_fit
from tests.reports import make_report


def test_parameters_of_one_name_belong_to_their_effects(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Friction and a load both have a torque; each has a row."""
    result = copy.deepcopy(dict(make_report(with_effect=True).result))
    load = result["effects"][0] | {"name": "load_torque"}
    result["effects"] = [result["effects"][0], load]

    print_fit(result, Path("out"))

    rows = [line.split()[0] for line in capsys.readouterr().out.splitlines() if "torque " in line]
    assert "coulomb_friction.torque" in rows
    assert "load_torque.torque" in rows
