"""The page of the library and the notebooks run as scripts."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import identification

ROOT = Path(__file__).parents[1]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Working directory with the data of the project, in which anything may be written."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module", autouse=True)
def equal_calls_once() -> Iterator[None]:
    """Let the page and the notebook that identify the same files in the same way share the fit."""
    identify = identification.identify
    found: dict[str, identification.Identification] = {}

    def once(*arguments: Any) -> identification.Identification:
        """Identify the runs, or return the result of an earlier call with equal arguments."""
        key = repr(arguments)
        if key not in found:
            found[key] = identify(*arguments)
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identification, "identify", once)
        yield


def test_blocks_of_the_page_run_in_order(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """docs/library.md is one script; its error message shows a mapping."""
    pytest.importorskip("arviz", reason="ArviZ is not installed")
    text = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
    scope: dict[str, Any] = {}

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for block in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
            exec(compile(block, "docs/library.md", "exec"), scope)

    assert 'a mapping such as {"voltage_V": {"column"' in capsys.readouterr().out
    assert {path.name for path in Path("out/motor").iterdir()} == {
        "result.json", "report.html", "posterior.nc",
    }  # fmt: skip
    assert Path("out/motor-17.html").is_file()


@pytest.mark.parametrize("name", ["first_motor", "own_data"])
def test_cells_of_the_notebook_run_in_order(name: str, checkout: Path) -> None:
    """The cells check their own numbers against data/*/truth.json; stored without outputs."""
    content = json.loads((ROOT / "docs" / "notebooks" / f"{name}.ipynb").read_text("utf-8"))
    scope: dict[str, Any] = {}

    for number, cell in enumerate(content["cells"]):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec(compile("".join(cell["source"]), f"{name}.ipynb, cell {number}", "exec"), scope)

    assert content["nbformat"] == 4
