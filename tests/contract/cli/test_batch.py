"""`motorid batch` and `motorid demo`: campaigns by list and by name."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from app.cli import main

FAST = ["--no-posterior", "--no-effects"]


def rows(path: Path) -> dict[str, dict[str, str]]:
    """Lines of results.csv by motor."""
    with path.open(encoding="utf-8", newline="") as file:
        return {row["motor"]: row for row in csv.DictReader(file)}


@pytest.fixture
def manifest(run_files: list[Path]) -> Path:
    """A good motor with a validation run, a motor whose run is missing, and another good one."""
    path = run_files[0].with_name("manifest.csv")
    path.write_text(
        "motor,training,validation\n"
        "one,run1.csv; run2.csv,run3.csv\n"
        "bad,run1.csv;nosuch.csv,\n"
        "\n"
        "two,run2.csv\n"
    )
    return path


def test_bad_motor_is_told_and_does_not_stop_the_others(
    manifest: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Status 1, since something failed; two of three rows with numbers, one with a reason."""
    status = main(["batch", str(manifest), "--out", str(tmp_path), *FAST])

    shown, told = capsys.readouterr()
    table = rows(tmp_path / "results.csv")
    assert status == 1
    assert told == f"motorid: 1 of 3 motors failed (bad); {tmp_path / 'results.csv'} says why\n"
    assert [table[name]["status"] for name in ("one", "bad", "two")] == [
        "fitted",
        "failed",
        "fitted",
    ]
    assert "nosuch.csv: cannot be opened" in table["bad"]["error"]
    result = json.loads((tmp_path / "one" / "result.json").read_text())
    assert float(table["one"]["Ra25"]) == result["parameters"]["Ra25"]["median"]
    assert [run["role"] for run in result["runs"]] == ["training", "training", "validation"]
    assert not (tmp_path / "bad").exists()
    assert [line.split()[:2] for line in shown.splitlines()[-3:]] == [
        ["one", "fitted"], ["bad", "failed"], ["two", "fitted"],
    ]  # fmt: skip


def test_batch_is_taken_up_where_it_was_left(run_files: list[Path], tmp_path: Path) -> None:
    """The second time nothing is fitted; after a run changed, or an option, it is."""
    bench = tmp_path / "bench"
    bench.mkdir()
    for file in run_files[:2]:
        (bench / file.name).write_bytes(file.read_bytes())
    (bench / "m.csv").write_text("motor,training\nm,run1.csv\n")
    out = tmp_path / "out"

    def statuses(*more: str) -> str:
        """Status of the one motor after the same command with more options."""
        assert main(["batch", str(bench / "m.csv"), "--out", str(out), "-q", *FAST, *more]) == 0
        return rows(out / "results.csv")["m"]["status"]

    assert [statuses(), statuses()] == ["fitted", "kept"]
    assert [statuses("--seed", "5"), statuses("--seed", "5")] == ["fitted", "kept"]
    (bench / "run1.csv").write_bytes((bench / "run2.csv").read_bytes())
    assert statuses("--seed", "5") == "fitted"


def test_demo_fits_the_training_runs_of_a_campaign(
    run_files: list[Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A campaign laid out like those in data/; the results go below out/ by its name."""
    folder = tmp_path / "data" / "servo"
    folder.mkdir(parents=True)
    for file, name in zip(run_files[:3], ("training_1", "training_2", "validation_1"), strict=True):
        (folder / f"{name}.csv").write_bytes(file.read_bytes())
    monkeypatch.chdir(tmp_path)

    assert main(["demo", "servo", "--no-posterior"]) == 0

    result = json.loads((tmp_path / "out" / "servo" / "result.json").read_text())
    assert [(run["file"], run["role"]) for run in result["runs"]] == [
        ("training_1.csv", "training"),
        ("training_2.csv", "training"),
        ("validation_1.csv", "validation"),
    ]
    assert capsys.readouterr().out.splitlines()[-1] == str(Path("out/servo/report.html"))
