"""Warnings of a result: the text is the message with its remedy, the code is for programs."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from identification.warning import ResultWarning

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
