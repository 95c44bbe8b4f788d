"""`motorid check`: what a fit would make of the runs, without fitting them."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from app.cli import main
from identification.ingest import read_run


def test_good_runs_are_accepted_with_the_next_command(
    run_files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """Each run and each parameter is shown, and nothing goes to standard error."""
    status = main(["check", *map(str, run_files)])
    shown = capsys.readouterr()
    assert status == 0
    assert shown.err == ""
    for word in ("run1.csv: 800 samples", "run4.csv", "alpha_Kt", "current_A"):
        assert word in shown.out
    assert re.search(r"^L +mH +\d", shown.out, re.MULTILINE), "the unit of the report"
    assert shown.out.rstrip().splitlines()[-1].startswith("next: motorid fit ")


def test_all_faults_of_all_files_are_shown_at_once(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A missing file and one of text: both stand in the output, the first on standard error."""
    text = tmp_path / "letter.csv"
    text.write_text("Dear bench,\n", encoding="utf-8")
    status = main(["check", str(run_files[0]), str(tmp_path / "none.csv"), str(text)])
    shown = capsys.readouterr()
    assert status == 2
    for name in ("none.csv", "letter.csv"):
        assert f"Not readable: {name}" in shown.out
    assert "run1.csv: 800 samples" in shown.out
    assert "next: motorid fit" not in shown.out
    assert len(shown.err.splitlines()) == 1
    assert "(and 1 more, see above)" in shown.err


def test_refusal_stands_once_on_a_terminal(
    run_files: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Output and errors of a terminal come together, so each fault is in one of them only."""
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    main(["check", *map(str, run_files[:2]), str(tmp_path / "none.csv"), str(tmp_path / "no.csv")])
    shown = capsys.readouterr()
    assert (shown.out + shown.err).count("cannot be opened") == 2
    assert shown.err.startswith("motorid: none.csv: cannot be opened")
    assert "Not readable: no.csv: cannot be opened" in shown.out

    main(["check", *map(str, run_files[:2]), "--map", "run2.csv:current_A=current_A * -1"])
    shown = capsys.readouterr()
    assert (shown.out + shown.err).count("has the wrong sign") == 1
    assert "correct it with --map" in shown.err


def test_quiet_check_prints_only_errors(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`-q` prints only errors, as for `fit`: none for good runs, one line for two missing files."""
    assert main(["check", "-q", *map(str, run_files)]) == 0
    assert capsys.readouterr() == ("", "")
    missing = [str(tmp_path / name) for name in ("none.csv", "lost.csv")]
    assert main(["check", "-q", *missing]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "none.csv" in shown.err
    assert "(and 1 more, run without -q to see them)" in shown.err
    assert len(shown.err.splitlines()) == 1


def test_reversed_current_is_shown_with_its_correction(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the correction that `check` prints, the same file is accepted."""
    header, *lines = run_files[1].read_text(encoding="utf-8").splitlines()
    turned = [header, *(_reversed(line, header) for line in lines)]
    file = tmp_path / "turned.csv"
    file.write_text("\n".join(turned) + "\n", encoding="utf-8")
    runs = [str(run_files[0]), str(run_files[2]), str(file)]

    assert main(["check", *runs, "--json"]) == 2
    content = json.loads(capsys.readouterr().out)
    corrections = [word for found in content["findings"] for word in found["corrections"]]
    assert content["accepted"] is False
    assert content["parameters"] == {}
    assert len(corrections) == 1

    assert main(["check", *runs, "--map", corrections[0]]) == 0


def test_saved_mapping_reads_the_same_run(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The mapping as understood, given to the reader, gives the same samples."""
    saved = tmp_path / "mapping.json"
    words = ["--map", "speed_rad_s=speed_rad_s * 2 + 1 in rpm", "--save-mapping", str(saved)]
    main(["check", str(run_files[0]), *words])
    capsys.readouterr()
    scaled = {"column": "speed_rad_s", "scale": 2.0, "offset": 1.0, "unit": "rpm"}
    expected = read_run(run_files[0], mapping={"speed_rad_s": scaled})
    found = read_run(run_files[0], mapping=saved)
    assert (found.speed == expected.speed).all()
    assert (found.voltage == expected.voltage).all()


def test_all_columns_at_fault_are_shown_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No unit, a unit of another quantity, an unknown unit: each with a mapping to copy."""
    file = tmp_path / "bad.csv"
    rows = "".join(f"{number},1,2,3\n" for number in range(60))
    file.write_text(f"time [s],U,I [V],n [foo]\n{rows}", encoding="utf-8")

    assert main(["check", str(file), "--json"]) == 2
    shown = capsys.readouterr()
    errors = {error["column"]: error for error in json.loads(shown.out)["errors"]}
    assert {column: error["code"] for column, error in errors.items()} == {
        "U": "ambiguous_unit",
        "I [V]": "wrong_unit",
        "n [foo]": "unknown_unit",
    }
    assert all(error["file"] == "bad.csv" for error in errors.values())
    assert {column: [*error["examples"][0]] for column, error in errors.items()} == {
        "U": ["voltage_V"],
        "I [V]": ["current_A"],
        "n [foo]": ["speed_rad_s"],
    }
    assert "(and 2 more, see above)" in shown.err


def test_option_of_the_message_reads_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No unit, and a unit of another quantity: the options shown are copied, with a gain of 2.

    The same error shows its mappings as JSON only in `--json`, as by HTTP.
    """
    file = tmp_path / "bad.csv"
    rows = "".join(f"{number},{number % 7},{number % 5},{number}\n" for number in range(60))
    file.write_text(f"time [s],U mot,I [V],n [rad/s]\n{rows}", encoding="utf-8")

    assert main(["check", str(file)]) == 2
    shown = capsys.readouterr()
    assert "--map 'voltage_V=U mot in V'" in shown.err
    assert "{" not in shown.out + shown.err
    given = re.findall(r"or give (--map .*)", shown.out)
    assert len(given) == 2
    words = [word for text in given for word in shlex.split(text.replace("NUMBER", "2"))]
    main(["check", str(file), *words, "--json"])
    content = json.loads(capsys.readouterr().out)
    assert not [error for error in content["errors"] if error["code"]]
    assert content["runs"][0]["channels"]["current_A"]["scale"] == 2.0


def test_option_of_the_message_reads_cells_in_another_unit(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The temperature of one of two files is in kelvin: the option shown is for that file."""
    rows = run_files[0].read_text(encoding="utf-8").splitlines()
    at = rows[0].split(",").index("temperature_degC")
    cells = [row.split(",") for row in rows[1:]]
    for row in cells:
        row[at] = f"{float(row[at]) + 273.15:.9f}"
    kelvin = tmp_path / "kelvin.csv"
    kelvin.write_text("\n".join([rows[0], *map(",".join, cells)]) + "\n", encoding="utf-8")

    assert main(["check", str(run_files[1]), str(kelvin)]) == 2
    [option] = re.findall(
        r"give the unit in the header, or give (--map '[^']*')", capsys.readouterr().err
    )
    assert option == "--map 'kelvin.csv:temperature_degC=temperature_degC in K'"
    main(["check", str(run_files[1]), str(kelvin), *shlex.split(option), "--json"])

    assert not json.loads(capsys.readouterr().out)["errors"]


def test_next_command_repeats_the_mapping(
    run_files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """Without it, the fit would read other columns than those examined."""
    main(["check", str(run_files[0]), "--map", "current_A=current_A * 1.5"])
    last = capsys.readouterr().out.rstrip().splitlines()[-1]
    assert last.endswith("--map 'current_A=current_A * 1.5' --out DIR")


def test_saved_mapping_replaces_no_run(
    run_files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """An existing file that is no mapping is kept, and the message names the option."""
    before = run_files[0].read_bytes()
    status = main(["check", str(run_files[0]), "--save-mapping", str(run_files[0])])
    assert status == 2
    assert run_files[0].read_bytes() == before
    assert "--save-mapping" in capsys.readouterr().err


def test_mapping_of_an_unreadable_file_is_not_saved(tmp_path: Path, run_files: list[Path]) -> None:
    """An earlier mapping is kept."""
    saved = tmp_path / "mapping.json"
    assert main(["check", str(run_files[0]), "--save-mapping", str(saved)]) == 0
    before = saved.read_bytes()
    words = [str(run_files[0]), str(tmp_path / "none.csv"), "--save-mapping", str(saved)]
    assert main(["check", *words]) == 2
    assert saved.read_bytes() == before


def test_runs_of_one_name_are_told_apart_by_their_folders(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three files named run.csv, one with reversed current: its correction concerns it alone."""
    paths = []
    for folder, source in zip("abc", run_files, strict=False):
        lines = source.read_text(encoding="utf-8").splitlines()
        if folder == "c":
            lines = [lines[0], *(_reversed(line, lines[0]) for line in lines[1:])]
        paths.append(tmp_path / folder / "run.csv")
        paths[-1].parent.mkdir()
        paths[-1].write_text("\n".join(lines) + "\n", encoding="utf-8")
    files = [str(path) for path in paths]

    assert main(["check", *files, "--json"]) == 2
    content = json.loads(capsys.readouterr().out)
    (correction,) = [word for found in content["findings"] for word in found["corrections"]]
    assert [run["file"] for run in content["runs"]] == ["a/run.csv", "b/run.csv", "c/run.csv"]
    assert correction.startswith("c/run.csv:current_A=")

    saved = tmp_path / "mapping.json"
    assert main(["check", *files, "--map", correction, "--save-mapping", str(saved)]) == 0
    assert main(["check", *files, "--mapping", str(saved)]) == 0


def _reversed(line: str, header: str) -> str:
    """A line of a run with the other sign of the current."""
    cells = line.split(",")
    column = header.split(",").index("current_A")
    cells[column] = repr(-float(cells[column]))
    return ",".join(cells)


@pytest.mark.parametrize(("rows", "voltage"), [(20, "5"), (100, "0")])
def test_runs_that_a_fit_refuses_are_refused(
    rows: int, voltage: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Too few samples together, and a motor that is never driven: the status is that of a fit."""
    file = tmp_path / "run.csv"
    lines = [f"{k / 1000},{voltage},{0.1 * (k % 7)},{k % 5}" for k in range(rows)]
    header = "time_s,voltage_V,current_A,speed_rad_s"
    file.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    assert main(["fit", str(file), "--out", str(tmp_path / "out")]) == 2
    capsys.readouterr()
    assert main(["check", str(file)]) == 2
    shown = capsys.readouterr().out
    assert "Not sufficient: run.csv" in shown
    assert "next: motorid fit" not in shown


def test_same_run_twice_is_noted(run_files: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Its samples would count twice; a fit warns of it, too."""
    assert main(["check", str(run_files[0]), str(run_files[0])]) == 0
    assert "hold the same samples" in capsys.readouterr().out
