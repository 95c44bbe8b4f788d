"""`motorid join`: one run file from files of one channel each."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from app.cli import main
from identification.ingest import read_run


@pytest.fixture
def channels(run_files: list[Path], tmp_path: Path) -> list[Path]:
    """A run as an oscilloscope saves it: volts of three channels, each in a file."""
    table = read_run(run_files[0]).table()
    gains = {"voltage_V": 1.0, "current_A": 10.0, "speed_rad_s": 50.0}
    files = []
    for number, (name, gain) in enumerate(gains.items(), start=1):
        files.append(tmp_path / f"CH{number}.csv")
        one = pd.DataFrame({"TIME [s]": table["time_s"], f"CH{number} [V]": table[name] / gain})
        one.to_csv(files[-1], index=False)
    return files


PROBES = ("voltage_V=CH1 [V]", "current_A=CH2 [V] * 10 in A", "speed_rad_s=CH3 [V] * 50 in rad/s")


def test_joined_file_is_a_run_without_a_mapping(
    channels: list[Path], run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run has the samples of the recording; what was assumed stands on standard error."""
    out = tmp_path / "new" / "run.csv"

    words = ["join", *map(str, channels), "--out", str(out)]
    status = main([*words, *(word for text in PROBES for word in ("--map", text))])

    run, recorded = read_run(out), read_run(run_files[0])
    assert status == 0
    assert [warning.code for warning in run.warnings] == ["no_temperature"]
    np.testing.assert_array_equal(run.time, recorded.time)
    np.testing.assert_allclose(run.current, recorded.current, rtol=1e-12)
    np.testing.assert_allclose(run.speed, recorded.speed, rtol=1e-12)
    assert "run.csv, column CH2 [V]: the header gives V" in capsys.readouterr().err


def test_file_of_one_channel_names_the_command_that_joins_them(
    channels: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`check` refuses the file; `join` without a mapping says what is missing, and writes none."""
    assert main(["check", str(channels[0])]) == 2
    refusal = capsys.readouterr().err
    assert main(["join", *map(str, channels), "--out", str(tmp_path / "run.csv")]) == 2

    assert "`motorid join FILE FILE FILE --out run.csv`" in refusal
    words = "--map 'voltage_V=CH1 [V] * V_PER_V' --map 'current_A=CH2 [V] * A_PER_V' --map 'speed_"
    command = f"motorid join {' '.join(map(str, channels))} --out {tmp_path / 'run.csv'} {words}"
    assert command in capsys.readouterr().err
    assert not (tmp_path / "run.csv").exists()


def test_command_of_the_refusal_writes_the_run(
    channels: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The words of the message, with numbers in place of the capitals, also of what was given."""
    for path in channels:
        path.write_text(path.read_text().replace("TIME [s]", "TIME"))
    out = tmp_path / "run.csv"
    given = ["join", *map(str, channels), "--out", str(out), "--map", "voltage_V=CH1 [V]"]

    assert main(given) == 2
    (message,) = capsys.readouterr().err.splitlines()
    words = shlex.split("motorid join" + message.split("motorid join")[-1])
    filled = [re.sub("[A-Z_]+_PER_V", "10", word) for word in words[1:]]

    assert main(filled) == 0
    assert read_run(out).rows > 0


def test_header_that_gives_the_unit_needs_none_in_the_mapping(
    channels: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command to copy has the columns alone, and writes the run."""
    for number, (path, unit) in enumerate(zip(channels, ("V", "A", "rad/s"), strict=True), 1):
        path.write_text(path.read_text().replace(f"CH{number} [V]", f"CH{number}({unit})"))
    out = tmp_path / "run.csv"

    assert main(["join", *map(str, channels), "--out", str(out)]) == 2
    message = capsys.readouterr().err.strip()
    words = shlex.split("motorid join" + message.split("motorid join")[-1])

    assert words[-5::2] == ["voltage_V=CH1(V)", "current_A=CH2(A)", "speed_rad_s=CH3(rad/s)"]
    assert main(words[1:]) == 0
    assert read_run(out).rows > 0


def test_no_channel_is_overwritten(channels: list[Path], tmp_path: Path) -> None:
    """The output has the name of an input."""
    before = channels[0].read_bytes()

    assert main(["join", *map(str, channels), "--out", str(channels[0])]) == 2

    assert channels[0].read_bytes() == before
