"""Preview of a run over HTTP: what `motorid check` shows, and nothing is stored."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli import main
from tests.app.service import Caller, run_text
from tests.ingest.scopes import SIDES, beside


def test_preview_is_what_the_command_prints(
    alice: Caller, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Columns, excitation, precision and notes of one run by both ways in."""
    file = tmp_path / "run.csv"
    file.write_bytes(run_text(1))
    answer = alice.http.post("/runs/preview", files={"file": (file.name, file.read_bytes())})

    assert main(["check", str(file), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert answer.status_code == 200
    assert answer.json() == {name: printed[name] for name in printed if name != "schema_version"}
    assert set(answer.json()["parameters"]) >= {"Ra25", "Kt25", "J"}


def test_preview_stores_nothing(alice: Caller) -> None:
    """The list of runs is the same before and after."""
    before = alice.http.get("/runs").json()
    alice.http.post("/runs/preview", files={"file": ("run.csv", run_text(3))})
    assert alice.http.get("/runs").json() == before


def test_unreadable_file_is_an_answer_with_its_error(alice: Caller) -> None:
    """The error has a code and names the file; the status is not that of a refused upload."""
    answer = alice.http.post("/runs/preview", files={"file": ("note.txt", b"Dear bench,\n")})
    assert answer.status_code == 200
    content = answer.json()
    assert content["accepted"] is False
    assert content["runs"] == []
    (error,) = content["errors"]
    assert error["file"] == "note.txt"
    assert error["code"]


def test_settings_beside_the_samples_are_no_columns(alice: Caller, tmp_path: Path) -> None:
    """A file of Tektronix TDS has one channel, and the error names the command to join several."""
    content = beside(tmp_path / "F0000CH1.CSV", 1, next(iter(SIDES.values())), ",").read_bytes()

    answer = alice.http.post("/runs/preview", files={"file": ("F0000CH1.CSV", content)})

    (error,) = answer.json()["errors"]
    assert error["code"] == "missing_column"
    assert "voltage_V may be 'CH1'" in error["message"]
    assert "motorid join" in error["message"]


def test_preview_applies_the_mapping(alice: Caller) -> None:
    """A mapping that is no JSON is refused; a valid one is used and returned."""
    files = {"file": ("run.csv", run_text(2))}
    mapping = {"speed_rad_s": {"column": "speed_rad_s", "unit": "rpm"}}

    refused = alice.http.post("/runs/preview", files=files, data={"mapping": "{"})
    answer = alice.http.post("/runs/preview", files=files, data={"mapping": json.dumps(mapping)})

    assert refused.status_code == 422
    assert answer.json()["mapping"]["speed_rad_s"] == mapping["speed_rad_s"]


def test_preview_takes_the_files_that_an_upload_takes(alice: Caller) -> None:
    """A run above the limit of other bodies (here 100,000 bytes) is examined."""
    header, *rows = run_text(4).splitlines(keepends=True)
    text = b"".join([b"# " + b"x" * 900 + b"\n"] * 200 + [header, *rows])
    answer = alice.http.post("/runs/preview", files={"file": ("long.csv", text)})
    assert answer.status_code == 200
    assert answer.json()["accepted"] is True
