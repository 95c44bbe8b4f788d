"""`motorid batch` and `motorid demo`: motors from a manifest and from a campaign in data/."""

from __future__ import annotations

import csv
import fcntl
import json
import os
from pathlib import Path

import pyarrow.parquet
import pytest

from app.cli import main
from app.commands.batch.manifest import read_manifest
from identification.options import FitOptions
from tests.app.service import PRETENDED

FAST = ["--no-posterior", "--no-effects"]


def rows(path: Path) -> dict[str, dict[str, str]]:
    """Rows of results.csv by motor."""
    with path.open(encoding="utf-8", newline="") as file:
        return {row["motor"]: row for row in csv.DictReader(file)}


@pytest.fixture
def manifest(run_files: list[Path]) -> Path:
    """Two valid motors, one with a validation run, and between them a motor with a missing run."""
    path = run_files[0].with_name("manifest.csv")
    path.write_text(
        "motor,training,validation\n"
        "one,run1.csv; run2.csv,run3.csv\n"
        "bad,run1.csv;nosuch.csv,\n"
        "\n"
        "two,run2.csv\n"
    )
    return path


def test_motor_with_a_run_twice_fails_alone(run_files: list[Path], tmp_path: Path) -> None:
    """A motor fails if it names a run twice, in both roles, or as two files with equal bytes."""
    path = run_files[0].with_name("twice.csv")
    run_files[0].with_name("copy.csv").write_bytes(run_files[0].read_bytes())
    path.write_text(
        "motor,training,validation\n"
        "named,run1.csv;run1.csv,\nchecked,run1.csv,run1.csv\ncopied,run1.csv,copy.csv\n"
        "good,run1.csv,run2.csv\n"
    )

    assert main(["batch", str(path), "--out", str(tmp_path), *FAST, "-q"]) == 1

    table = rows(tmp_path / "results.csv")
    reasons = {name: row["error"] for name, row in table.items()}
    twice = f"{run_files[0]}: is listed twice; expected each run once, in one role"
    assert reasons["named"] == reasons["checked"] == twice
    assert f"copy.csv: has the same content as {run_files[0]}; expected each" in reasons["copied"]
    assert (table["good"]["status"], reasons["good"]) == ("fitted", "")


@pytest.mark.parametrize("form", ["csv", "yaml"])
def test_wildcard_stands_for_files_in_the_order_of_their_numbers(tmp_path: Path, form: str) -> None:
    """The order of recording is that of the numbers; a file named with brackets is no pattern."""
    names = ["run10.csv", "run9.csv", "check[1].csv", "check1.csv", "notes.txt"]
    for name in names:
        (tmp_path / name).touch()
    manifest = tmp_path / f"motors.{form}"
    manifest.write_text(
        "motor,training,validation\nm,run*.csv,check[1].csv\nn,none*.csv,\n"
        if form == "csv"
        else "motors: [{motor: m, training: 'run*.csv', validation: ['check[1].csv']}, "
        "{motor: n, training: ['none*.csv']}]"
    )

    found, without = read_manifest(manifest, FitOptions())

    assert [path.name for path in found.training] == ["run9.csv", "run10.csv"]
    assert [path.name for path in found.validation] == ["check[1].csv"]
    assert [path.name for path in without.training] == ["none*.csv"]


def test_pattern_that_matches_nothing_is_called_so(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The motor fails alone, and its reason speaks of a pattern and not of permissions."""
    manifest = run_files[0].with_name("motors.csv")
    manifest.write_text("motor,training\nm,none*.csv\n")

    assert main(["batch", str(manifest), "--out", str(tmp_path)]) == 1

    assert "none*.csv: no file matches this pattern" in capsys.readouterr().out


def test_pipe_is_refused_without_waiting(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A pipe is rejected as manifest, as run and as mapping, with one line."""
    pipe = run_files[0].with_name("pipe.csv")
    os.mkfifo(pipe)
    path = pipe.with_name("pipes.yaml")
    path.write_text(
        "motors:\n"
        "- {motor: run, training: [pipe.csv]}\n"
        "- {motor: mapping, training: [run1.csv], mapping: pipe.csv}\n"
    )
    out = ["--out", str(tmp_path / "out")]

    assert main(["batch", str(path), *out, *FAST, "-q"]) == 1
    table = rows(tmp_path / "out" / "results.csv")
    assert {row["error"] for row in table.values()} == {
        f"{pipe}: is not a regular file; expected a run or a mapping"
    }
    capsys.readouterr()
    for words in (
        ["batch", str(pipe)],
        ["fit", str(pipe)],
        ["fit", str(run_files[0]), "--mapping", str(pipe)],
    ):
        assert main([*words, *out]) == 2
        told = capsys.readouterr().err
        assert "is not a regular file" in told
        assert told.count("\n") == 1


def test_failed_motor_is_reported_and_does_not_stop_the_others(
    manifest: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The status is 1, and the table has two rows with numbers and one with the error."""
    status = main(["batch", str(manifest), "--out", str(tmp_path), *FAST])

    shown, told = capsys.readouterr()
    table = rows(tmp_path / "results.csv")
    assert status == 1
    path = tmp_path / "results.csv"
    assert told == (
        f"motorid: 1 of 3 motors failed (bad); the column `error` of {path} gives the reasons\n"
    )
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
    assert shown.splitlines()[-1] == f"bad: {table['bad']['error']}"
    assert [line.split()[:2] for line in shown.splitlines()[-4:-1]] == [
        ["one", "fitted"], ["bad", "failed"], ["two", "fitted"],
    ]  # fmt: skip


def test_batch_is_resumed(
    run_files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second batch fits nothing again, unless a run or an option has changed."""
    monkeypatch.setenv("MOTORID_PIPELINE", PRETENDED)
    bench = tmp_path / "bench"
    bench.mkdir()
    for file in run_files[:2]:
        (bench / file.name).write_bytes(file.read_bytes())
    (bench / "m.csv").write_text("motor,training\nm,run1.csv\n")
    out = tmp_path / "out"

    def statuses(*more: str) -> str:
        """Status of the motor after the command with further options."""
        assert main(["batch", str(bench / "m.csv"), "--out", str(out), "-q", *more]) == 0
        return rows(out / "results.csv")["m"]["status"]

    assert [statuses(), statuses()] == ["fitted", "kept"]
    assert [statuses("--no-posterior"), statuses("--no-posterior")] == ["fitted", "kept"]
    (bench / "run1.csv").write_bytes((bench / "run2.csv").read_bytes())
    assert statuses("--no-posterior") == "fitted"


def test_refit_is_compared_with_the_previous_fit(run_files: list[Path], tmp_path: Path) -> None:
    """The drift is the difference of the medians of both results; the first fit has none."""
    out = tmp_path / "out"
    medians, lines = [], []
    for number in (0, 2):
        names = ";".join(str(file) for file in run_files[number : number + 2])
        (tmp_path / "m.csv").write_text(f"motor,training\nm,{names}\n")
        assert main(["batch", str(tmp_path / "m.csv"), "--out", str(out), "-q", *FAST]) == 0
        result = json.loads((out / "m" / "result.json").read_text())
        medians.append(result["parameters"]["J"]["median"])
        lines.append(rows(out / "results.csv")["m"])
    first, second = lines
    (earlier,) = (out / "m" / "history").iterdir()

    assert first["J_drift"] == first["previous_fit"] == ""
    assert float(second["J_drift"]) == medians[1] - medians[0]
    assert float(second["J_drift_relative"]) == (medians[1] - medians[0]) / medians[0]
    assert second["previous_fit"] == f"m/history/{earlier.name}"
    assert (second["previous_ended_at"], second["previous_shared_runs"]) == (first["ended_at"], "0")
    assert pyarrow.parquet.read_table(out / "results.parquet").to_pylist()[0]["J"] == medians[1]
    assert ">m</a>" in (out / "fleet.html").read_text(encoding="utf-8")


PRETENDED_MANIFEST = """
options: {posterior: false}
motors:
  - {motor: quick, training: [run1.csv, run2.csv], validation: [run3.csv]}
  - {motor: killed, training: [run1.csv], options: {seed: 2}}
  - {motor: stuck, training: [run1.csv], options: {seed: 3}}
  - {motor: unsolved, training: [run1.csv], options: {seed: 4}}
  - {motor: bug, training: [run1.csv], options: {seed: 5}}
  - {motor: last, training: [run2.csv], options: {posterior: true, temperatures: [20, 80.5]}}
"""


def test_no_motor_stops_another_however_it_fails(
    run_files: list[Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The seed of the mock pipeline selects a signal, bad input, no solution or a bug."""
    monkeypatch.setenv("MOTORID_PIPELINE", PRETENDED)
    manifest = run_files[0].with_name("several.yaml")
    manifest.write_text(PRETENDED_MANIFEST)

    status = main(["batch", str(manifest), "--out", str(tmp_path), "--jobs", "2", "--json"])

    table = rows(tmp_path / "results.csv")
    assert status == 1
    shown, told = capfd.readouterr()
    assert told.count("\n") == 1
    assert "4 of 6 motors failed (killed, stuck, unsolved, bug)" in told
    assert [row["status"] for row in json.loads(shown)] == [r["status"] for r in table.values()]
    assert {name: row["status"] for name, row in table.items()} == {
        "quick": "fitted", "killed": "failed", "stuck": "failed", "unsolved": "failed",
        "bug": "failed", "last": "fitted",
    }  # fmt: skip
    assert "by signal 9" in table["killed"]["error"]
    assert "row 7, column speed_rad_s: the speed never moves" in table["stuck"]["error"]
    assert table["unsolved"]["error"] == "no step made the error smaller"
    assert table["bug"]["error"] == "internal error, RuntimeError: a bug"
    assert not (tmp_path / "quick" / "posterior.nc").exists()
    assert (tmp_path / "last" / "posterior.nc").exists()
    last = json.loads((tmp_path / "last" / "result.json").read_text())
    assert last["temperatures"] == [20.0, 80.5]


def test_options_stand_in_columns_of_a_csv_manifest(
    run_files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty cell selects the option of the command line; `mapping` names a JSON file."""
    monkeypatch.setenv("MOTORID_PIPELINE", PRETENDED)
    text = run_files[0].read_text().replace("speed_rad_s", "n_ist")
    (tmp_path / "odd.csv").write_text(text)
    (tmp_path / "map.json").write_text('{"speed_rad_s": {"column": "n_ist", "unit": "rad/s"}}')
    (tmp_path / "m.csv").write_text(
        "temperatures,motor,posterior,training,mapping\n"
        "0;50,one,no,odd.csv,map.json\n"
        f",two,,{run_files[0]}\n"
    )

    assert main(["batch", str(tmp_path / "m.csv"), "--out", str(tmp_path / "o"), "-q"]) == 0

    results = [json.loads((tmp_path / "o" / m / "result.json").read_text()) for m in ("one", "two")]
    assert [result["temperatures"] for result in results] == [[0.0, 50.0], [25.0, 125.0]]
    assert results[0]["speeds"] == results[1]["speeds"]
    assert [(tmp_path / "o" / m / "posterior.nc").exists() for m in ("one", "two")] == [False, True]


def test_second_batch_in_the_same_directory_is_refused(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """While one batch holds the lock of the directory, another exits with status 2."""
    manifest = tmp_path / "m.csv"
    manifest.write_text(f"motor,training\nm,{run_files[0]}\n")

    with (tmp_path / ".lock").open("ab") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        status = main(["batch", str(manifest), "--out", str(tmp_path)])

    assert status == 2
    assert "another batch is writing to it; wait until it ends" in capsys.readouterr().err


def test_demo_fits_the_training_runs_of_a_campaign(
    run_files: list[Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The campaign is read from data/ and its results are written to out/ under its name."""
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
