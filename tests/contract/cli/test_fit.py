"""`motorid fit` as called from a shell: files, arguments, output and exit status."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from app.cli import main
from identification.result.schema import result_schema
from tests.motors import NAMES, motor_named

FAST = ["--no-posterior", "--no-effects"]


def words(*parts: object) -> list[str]:
    """Arguments as a shell passes them."""
    return [str(part) for part in parts]


def test_fit_without_posterior_writes_result_and_report_only(fitted: Path) -> None:
    """The directory contains no posterior.nc and no temporary file."""
    assert sorted(path.name for path in fitted.iterdir()) == ["report.html", "result.json"]


def test_result_of_the_command_line_fulfils_the_published_schema(fitted: Path) -> None:
    """result.json conforms to the schema and contains neither NaN nor Infinity."""
    jsonschema = pytest.importorskip("jsonschema")
    text = (fitted / "result.json").read_text(encoding="utf-8")

    def refuse(word: str) -> None:
        """Reject a number that Python accepts and JSON does not define."""
        raise AssertionError(word)

    jsonschema.validate(json.loads(text, parse_constant=refuse), result_schema())


def test_parameters_agree_with_the_simulated_motor(fitted: Path) -> None:
    """Each estimate is within five of its standard deviations of the true value."""
    truth = dict(zip(NAMES, motor_named("servo 100 W").values, strict=True))
    parameters = json.loads((fitted / "result.json").read_text(encoding="utf-8"))["parameters"]

    for name, value in truth.items():
        entry = parameters[name]
        assert abs(entry["median"] - value) < 5 * entry["sd"], name


def test_runs_are_listed_with_their_role_in_the_order_given(fitted: Path) -> None:
    """The result lists three training runs, then the run of --validation."""
    runs = json.loads((fitted / "result.json").read_text(encoding="utf-8"))["runs"]

    assert [(run["file"], run["role"], run["rows"]) for run in runs] == [
        ("run1.csv", "training", 800),
        ("run2.csv", "training", 800),
        ("run3.csv", "training", 800),
        ("run4.csv", "validation", 800),
    ]


@pytest.mark.parametrize("name", ["run1.csv", "copy.csv"])
def test_validation_on_a_training_run_is_refused(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """A training file and a copy of it are rejected with status 2 and one line."""
    fitted = tmp_path / "run1.csv"
    checked = tmp_path / name
    for file in {fitted, checked}:
        file.write_bytes(run_files[0].read_bytes())
    out = tmp_path / "out"

    assert main(words("fit", fitted, "--validation", checked, "--out", out, *FAST)) == 2

    error = capsys.readouterr().err
    assert f"{checked}: has the same content as the training run {fitted}" in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_validation_runs_share_an_option_or_have_one_each(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both forms give the same roles, with the options before or after the runs."""
    a, b, c, d = run_files
    spellings = [
        words("fit", a, b, "--validation", c, d, "--out", tmp_path / "one", *FAST),
        words("fit", "--validation", c, "--validation", d, *FAST, "--out", tmp_path / "two", a, b),
    ]

    results = []
    for spelling in spellings:
        assert main([*spelling, "--quiet"]) == 0
        content = json.loads(
            (Path(spelling[spelling.index("--out") + 1]) / "result.json").read_text()
        )
        results.append([(run["file"], run["role"]) for run in content["runs"]])

    assert results[0] == results[1]
    assert [role for _, role in results[0]] == ["training"] * 2 + ["validation"] * 2
    assert capsys.readouterr() == ("", "")


def test_table_names_every_parameter_warnings_first_and_files_last(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table of runs at a single temperature marks alpha_Ra as not identified."""
    cold = tmp_path / "cold.csv"
    lines = run_files[0].read_text(encoding="utf-8").splitlines()
    cells = [line.split(",") for line in lines]
    column = cells[0].index("temperature_degC")
    for row in cells[1:]:
        row[column] = "25.0"
    cold.write_text("\n".join(",".join(row) for row in cells) + "\n", encoding="utf-8")

    assert main(words("fit", cold, "--out", tmp_path / "out", *FAST)) == 0

    shown, remarks = capsys.readouterr()
    rows = {line.split()[0]: line for line in shown.splitlines() if line.strip()}
    assert set(NAMES) <= set(rows)
    assert rows["alpha_Ra"].split()[-1] == "NO"
    assert rows["Ra25"].split()[-1] == "yes"
    assert rows["L"].split()[1] == "mH", "the unit of the report"
    assert "25 °C" in shown
    assert "125 °C" in shown
    assert "Settling time, 2 % [ms]" in shown
    assert shown.splitlines()[-1] == str(tmp_path / "out" / "report.html")
    warnings = json.loads((tmp_path / "out" / "result.json").read_text())["warnings"]
    # Long lines are wrapped.
    first = "".join(f"Warning: {warning} " for warning in warnings)
    assert " ".join(shown.split()).startswith(f"{first}What to do: docs/troubleshooting.md on ")
    assert remarks == ""


def test_json_summary_is_the_only_output(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A script can parse all of standard output; the paths in it exist."""
    out = tmp_path / "out"
    names = ["--motor", "servo <3>", "--bench", "bench 4"]

    given = words("fit", run_files[0], run_files[1], "--out", out, "--json", *FAST, *names)
    assert main(given) == 0

    summary = json.loads(capsys.readouterr().out)
    assert Path(summary["files"]["result"]).exists()
    assert Path(summary["files"]["report"]).exists()
    assert summary["files"]["posterior"] is None
    result = json.loads((out / "result.json").read_text())
    assert summary["parameters"] == result["parameters"]
    assert result["label"] == {"motor": "servo <3>", "bench": "bench 4"}
    Draft202012Validator(result_schema()).validate(result)
    head = (out / "report.html").read_text(encoding="utf-8").partition("</header>")[0]
    assert ">Motor</span> servo &lt;3&gt;" in head
    assert head.index("bench 4") < head.index(">Date<")


def test_other_temperatures_and_controllers_reach_the_feedback_list(
    run_files: list[Path], tmp_path: Path
) -> None:
    """An option takes several values, including a negative temperature."""
    out = tmp_path / "out"

    status = main(
        words(
            "fit", run_files[0], run_files[1], "--out", out, *FAST, "--quiet",
            "--temperature", -40, 25, "--controller", "P:2", "PI:2,5",
        )
    )  # fmt: skip

    entries = json.loads((out / "result.json").read_text())["feedback"]
    assert status == 0
    assert [(entry["controller"], entry["temperature_degC"]) for entry in entries] == [
        ("P:2", -40.0), ("P:2", 25.0), ("PI:2,5", -40.0), ("PI:2,5", 25.0),
    ]  # fmt: skip


def test_mapping_by_file_and_by_words_reads_foreign_columns(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Mapped headers, a current in mA and a scaled speed give the same estimate."""
    names = {"current_A": "shunt", "speed_rad_s": "tacho (amplified)", "time_s": "time_s"}
    lines = [line.split(",") for line in run_files[0].read_text(encoding="utf-8").splitlines()]
    header = lines[0]
    for row in lines[1:]:
        row[header.index("current_A")] = repr(1000 * float(row[header.index("current_A")]))
        row[header.index("speed_rad_s")] = repr(float(row[header.index("speed_rad_s")]) / 4)
    foreign = tmp_path / "foreign.csv"
    lines[0] = [names.get(name, name) for name in header]
    foreign.write_text("\n".join(map(",".join, lines)) + "\n", encoding="utf-8")
    mapping = tmp_path / "mapping.json"
    mapping.write_text(json.dumps({"current_A": {"column": "shunt", "unit": "mA"}}))

    for file, out, more in (
        (run_files[0], "own", []),
        (foreign, "words", ["--map", "current_A=shunt in mA", "--map"]),
        (foreign, "file", ["--mapping", mapping, "--map"]),
    ):
        tail = ["speed_rad_s=tacho (amplified) * 4"] if more else []
        status = main(words("fit", file, "--out", tmp_path / out, *FAST, "--quiet", *more, *tail))
        assert (status, capsys.readouterr().err) == (0, "")

    medians = [
        json.loads((tmp_path / out / "result.json").read_text())["parameters"]["Ra25"]["median"]
        for out in ("own", "words", "file")
    ]
    assert medians[1] == medians[2] == pytest.approx(medians[0], rel=1e-6)


def test_results_of_an_earlier_fit_stay_when_the_next_one_is_refused(
    run_files: list[Path], fitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A malformed run is rejected before anything is written; bytes and times are unchanged."""
    broken = tmp_path / "broken.csv"
    broken.write_text(run_files[0].read_text(encoding="utf-8").replace(",", ",x", 40))
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in fitted.iterdir()}

    status = main(words("fit", broken, "--out", fitted, *FAST))

    assert status == 2
    assert {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in fitted.iterdir()} == before
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_refused_input_leaves_no_directory_behind(tmp_path: Path) -> None:
    """The output directory is created only after the runs were read."""
    assert main(words("fit", tmp_path / "nosuch.csv", "--out", tmp_path / "a" / "b")) == 2

    assert list(tmp_path.iterdir()) == []


def test_fit_loads_neither_the_service_nor_the_exports(
    run_files: list[Path], tmp_path: Path
) -> None:
    """A new interpreter lists its modules after a complete fit."""
    program = (
        "import sys\nfrom app.cli import main\nassert main(sys.argv[1:]) == 0\n"
        "print([m for m in ('fastapi', 'starlette', 'uvicorn', 'sqlalchemy', 'alembic', "
        "'identification.export') if m in sys.modules])"
    )

    run = subprocess.run(
        [
            sys.executable,
            "-c",
            program,
            *words("fit", run_files[0], "--out", tmp_path),
            *FAST,
            "-q",
        ],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
    )

    assert (run.returncode, run.stdout.strip(), run.stderr) == (0, "[]", "")
