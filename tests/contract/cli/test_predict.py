"""`motorid predict`: simulated sensor readings of a run."""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.cli import main
from identification.ingest import read_run, write_run


def table(path: Path) -> dict[str, NDArray[np.float64]]:
    """Columns of a prediction."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.mark.parametrize("more", [[], ["--declared"]], ids=["final", "declared"])
def test_prediction_has_a_row_for_each_sample_and_fits_the_run(
    fitted: Path, run_files: list[Path], tmp_path: Path, more: list[str]
) -> None:
    """The error is below 2 % of the standard deviation; the noise of the run is 1 %."""
    out = tmp_path / "new" / "prediction.csv"

    status = main(
        ["predict", str(fitted / "result.json"), str(run_files[3]), "--out", str(out), *more]
    )

    run, predicted = read_run(run_files[3]), table(out)
    assert status == 0
    assert list(predicted) == ["time_s", "current_A", "speed_rad_s"]
    np.testing.assert_array_equal(predicted["time_s"], run.time)
    for name, measured in (("current_A", run.current), ("speed_rad_s", run.speed)):
        error = predicted[name] - measured
        assert np.sqrt(np.mean(error**2)) < 0.02 * np.std(measured), name


def test_prediction_uses_current_and_speed_for_the_start_only(
    fitted: Path, run_files: list[Path], tmp_path: Path
) -> None:
    """Overwriting both channels in the second half leaves the prediction unchanged."""
    lines = run_files[3].read_text(encoding="utf-8").splitlines()
    header = lines[0].split(",")
    spoilt = []
    for number, line in enumerate(lines):
        cells = line.split(",")
        if number > 400:
            cells[header.index("current_A")] = repr(0.01 * (number % 7))
            cells[header.index("speed_rad_s")] = repr(0.1 * (number % 5))
        spoilt.append(",".join(cells))
    (tmp_path / "spoilt.csv").write_text("\n".join(spoilt) + "\n", encoding="utf-8")

    for run, out in ((run_files[3], "a.csv"), (tmp_path / "spoilt.csv", "b.csv")):
        words = ["predict", str(fitted / "result.json"), str(run), "--out", str(tmp_path / out)]
        assert main(words) == 0

    own, other = table(tmp_path / "a.csv"), table(tmp_path / "b.csv")
    for name in ("current_A", "speed_rad_s"):
        tail = slice(500, None)
        np.testing.assert_allclose(
            other[name][tail], own[name][tail], atol=0.03 * float(np.std(own[name]))
        )


def test_run_beyond_the_fitted_range_is_predicted_with_a_remark(
    fitted: Path, run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Twice the voltage is an extrapolation; a training run is none."""
    words = ["predict", str(fitted / "result.json"), str(run_files[0])]

    assert main([*words, "--out", str(tmp_path / "a.csv")]) == 0
    own = capsys.readouterr().err
    double = ["--map", "voltage_V=voltage_V * 2"]
    assert main([*words, "--out", str(tmp_path / "b.csv"), *double]) == 0
    beyond = capsys.readouterr().err

    assert "range of the fitted runs" not in own
    assert f"{run_files[0].name} leaves the range of the fitted runs (voltage " in beyond


def test_run_in_another_unit_is_predicted_with_its_correction(
    fitted: Path, run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The speed is in rpm under a header in rad/s; the correction in the remark removes it."""
    run = read_run(run_files[3])
    write_run(replace(run, speed=run.speed * 30.0 / np.pi), tmp_path / "rpm.csv")
    words = ["predict", str(fitted / "result.json"), str(tmp_path / "rpm.csv")]

    assert main([*words, "--out", str(tmp_path / "a.csv")]) == 0
    remark = capsys.readouterr().err
    correction = re.findall("--map '([^']*)'", remark)
    assert main([*words, "--out", str(tmp_path / "b.csv"), "--map", *correction]) == 0

    assert "rpm.csv contradicts physics or the result" in remark
    assert "probably in rpm" in remark
    assert correction == ["rpm.csv:speed_rad_s=speed_rad_s * 0.10471975512"]
    assert "contradicts" not in capsys.readouterr().err
    assert (tmp_path / "a.csv").exists()


def test_prediction_replaces_an_older_one(
    fitted: Path, run_files: list[Path], tmp_path: Path
) -> None:
    """The file is replaced, has ordinary permissions, and no temporary file is left."""
    out = tmp_path / "p.csv"
    out.write_text("old")

    assert main(["predict", str(fitted / "result.json"), str(run_files[3]), "--out", str(out)]) == 0

    assert [path.name for path in tmp_path.iterdir()] == ["p.csv"]
    assert out.read_text(encoding="utf-8").startswith("time_s,current_A,speed_rad_s\n")
    assert out.stat().st_mode & 0o444 == 0o444


@pytest.mark.parametrize("spoilt", ["-5", "0", "1" + "0" * 400], ids=["negative", "zero", "huge"])
def test_result_whose_parameters_are_impossible_is_refused(
    fitted: Path,
    run_files: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    spoilt: str,
) -> None:
    """The command exits with status 2 and names the parameter."""
    result = json.loads((fitted / "result.json").read_text(encoding="utf-8"))
    result["parameters"]["L"]["estimate"] = int(spoilt)
    (tmp_path / "spoilt.json").write_text(json.dumps(result), encoding="utf-8")

    status = main(
        ["predict", str(tmp_path / "spoilt.json"), str(run_files[3]), "--out", str(tmp_path / "p")]
    )

    assert status == 2
    assert "L of the result is" in capsys.readouterr().err
    assert not (tmp_path / "p").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["predict", "DIR/result.json", "RUN", "--out", "RUN"],
        ["predict", "DIR/result.json", "RUN", "--out", "LINK"],
        ["predict", "DIR/result.json", "RUN", "--out", "DIR/result.json"],
        ["feedback", "--result", "DIR/result.json", "--out", "DIR/result.json"],
        ["export", "DIR/result.json", "--to", "csv", "--out", "DIR/result.json"],
        ["export", "DIR", "--to", "csv", "--out", "DIR/result.json"],
        ["export", "DIR/result.json", "--to", "csv", "--out", "DIR/report.html"],
    ],
    ids=["run", "link", "result", "metrics", "export", "directory", "report"],
)
def test_no_input_is_overwritten(
    fitted: Path,
    run_files: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
) -> None:
    """A measured run exists once; a command that would replace what it reads ends with status 2."""
    copied = shutil.copytree(fitted, tmp_path / "fit")
    run = Path(shutil.copy(run_files[3], tmp_path / "run.csv"))
    (tmp_path / "link.csv").symlink_to(run)
    before = {path: path.read_bytes() for path in (run, *copied.iterdir())}
    names = {"DIR": str(copied), "RUN": str(run), "LINK": str(tmp_path / "link.csv")}

    status = main([re.sub("DIR|RUN|LINK", lambda found: names[found[0]], a) for a in arguments])

    assert status == 2
    assert "is an input of this command" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (run, *copied.iterdir())} == before
