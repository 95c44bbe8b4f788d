"""`motorid export`: a file in the format of another program."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli import main
from identification.export import FORMATS
from tests.contract.cli.test_documentation import help_text
from tests.export.results import STEP, result_with


@pytest.fixture
def result(tmp_path: Path) -> Path:
    """Result with a load in one run, in a file."""
    path = tmp_path / "result.json"
    path.write_text(json.dumps(result_with(STEP)), encoding="utf-8")
    return path


def test_what_the_file_does_not_hold_is_said_on_standard_error_and_in_the_file(
    result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The load step of run 2 is named in both places, and standard output is empty."""
    out = tmp_path / "new" / "motor.c"

    status = main(["export", str(result), "--to", "c", "--out", str(out)])

    said = capsys.readouterr()
    note = "load_step acts only in runs of the campaign (run 2); it is left out"
    assert (status, said.out) == (0, "")
    assert f"motorid: {note}" in said.err
    assert note in out.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--to", "excel"], f"expected {', '.join(FORMATS)}"),
        (["--to", "c", "--temperature", "40"], "the format c has no linear models"),
        (["--to", "csv", "--temperature", "40"], "the format csv has no linear models"),
        (
            ["--to", "matlab", "--temperature", "900"],
            "temperature is 900 degC; expected -273.15 to 400",
        ),
        (["--to", "c", "--temperature", "warm"], "warm"),
        ([], "--to"),
    ],
)
def test_an_argument_that_is_not_accepted_is_one_line_with_status_2(
    result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    """The line says what was expected, and no file is written."""
    status = main(["export", str(result), "--out", str(tmp_path / "x"), *words])

    said = capsys.readouterr().err
    assert status == 2
    assert told in said
    assert said.startswith("motorid: ")
    assert said.count("\n") == 1
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("spoilt", "told"),
    [
        ({"schema_version": 2}, "schema_version 2"),
        ({"effects": [{"name": "ghost"}]}, "effect 'ghost' is not known"),
        ({"parameters": {}}, "no value of Ra25"),
        ({"declared": 5}, "no object 'declared'"),
    ],
)
def test_a_result_that_is_not_accepted_is_one_line_with_status_2(
    result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    spoilt: dict[str, object], told: str,
) -> None:  # fmt: skip
    """The line names what the result lacks."""
    content = json.loads(result.read_text(encoding="utf-8")) | spoilt
    result.write_text(json.dumps(content), encoding="utf-8")

    status = main(["export", str(result), "--to", "c", "--out", str(tmp_path / "x")])

    said = capsys.readouterr().err
    assert status == 2
    assert told in said
    assert said.count("\n") == 1


def test_help_names_every_format() -> None:
    """The formats of the help are those of the library."""
    text = " ".join(help_text("motorid export").split())

    assert f"Format of the file: {', '.join(FORMATS)}." in text
