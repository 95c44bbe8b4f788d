"""Warnings of a result: the text is the message with its remedy, the code is for programs."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import get_args

import pytest

from app.fits.schemas import FitOptionsIn
from identification.warning import Option, ResultWarning, both_ways

ROOT = Path(__file__).parents[1]


def test_text_is_the_message_and_then_the_remedy() -> None:
    """A warning without remedy ends with its message."""
    alone = ResultWarning("gap", "note", "run1.csv: 2 gaps")
    mended = ResultWarning("repeated_runs", "warning", "two runs are the same", "give each once")

    assert str(alone) == "run1.csv: 2 gaps"
    assert str(mended) == "two runs are the same; give each once"
    assert mended.details() == {
        "code": "repeated_runs",
        "severity": "warning",
        "fix": "give each once",
    }


def calls_of(path: Path) -> list[ast.Call]:
    """Calls of a module that make a warning or a finding."""
    nodes = ast.walk(ast.parse(path.read_text("utf-8")))
    names = ("ResultWarning", "Finding", "refusal", "suspicion")
    return [n for n in nodes if isinstance(n, ast.Call) and getattr(n.func, "id", "") in names]


def test_remedy_with_an_option_names_the_field_and_the_option_of_the_service() -> None:
    """A page or an answer of the service has no command line; `fix_http` says what to use there."""
    warning = ResultWarning("x", "warning", "L is uncertain", "give --known L=VALUE", "known")

    assert warning.details()["fix_http"] == "“Known values”, or option known"
    assert "--known" in str(warning)


@pytest.mark.parametrize("option", get_args(Option))
def test_options_of_the_service_exist(option: Option) -> None:
    """Each is a field of a fit request, of a run or of a prediction."""
    way = ResultWarning("x", "note", "", "", option).details()["fix_http"]
    name = re.findall(r"(?:option |member )?(\w+)(?:=true)?$", way)[0]

    requests = {*FitOptionsIn.model_fields, "mapping", "declared"}
    assert name in requests
    assert both_ways(option) == f"--{option.replace('_', '-')} (service: {way})"


def test_no_warning_names_an_option_without_the_way_of_the_service() -> None:
    """Each warning and finding of the library whose text has an option gives its name."""
    for file in (ROOT / "identification").rglob("*.py"):
        for call in calls_of(file):
            texts = [n.value for n in ast.walk(call) if isinstance(n, ast.Constant)]
            if re.search(r"(?<!\w)--[a-z]+(?! \(option)", " ".join(map(str, texts))):
                assert set(texts) & {*get_args(Option)}, f"{file.name}: {texts}"


def test_every_code_of_the_library_is_in_the_documentation() -> None:
    """First argument of each `ResultWarning(...)`, or the constant of the module that it names."""
    page = (ROOT / "docs/result-json.md").read_text("utf-8")
    codes = set()
    for file in (ROOT / "identification").rglob("*.py"):
        tree = ast.parse(file.read_text("utf-8"))
        constants = {
            node.target.id: node.value.value
            for node in tree.body
            if isinstance(node, ast.AnnAssign)
            and isinstance(node.target, ast.Name)
            and isinstance(node.value, ast.Constant)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "ResultWarning":
                code = node.args[0]
                if isinstance(code, ast.Constant):
                    codes.add(code.value)
                elif isinstance(code, ast.Name):
                    codes.add(constants[code.id])

    assert len(codes) > 15
    assert codes <= set(re.findall(r"`(\w+)`", page.partition("### warning_details")[2]))
