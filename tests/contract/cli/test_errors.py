"""Errors on the command line: exit status and one line, never a traceback."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from app.cli import main
from app.commands import motor
from app.commands.console import progress_bar
from app.commands.exits import EXIT_STATUS, raise_missed, raised_signals
from identification.errors import ComputationError

ROOT = Path(__file__).parents[3]
MOTOR = ["--set", "Ra25=0.59", "Kt25=0.071", "J=0.01", "b=0.1", "L=0.5"]
COLD = ["--temperature", "25"]

REFUSED = {
    "unknown command": (["guess"], "No such command 'guess'"),
    "unknown option": (["fit", "a.csv", "--bogus"], "No such option: --bogus"),
    "no run": (["fit", "--out", "o"], "Missing argument 'RUN...'"),
    "no directory": (["fit", "a.csv"], "Missing option '--out'"),
    "option without value": (["fit", "a.csv", "--out"], "requires an argument"),
    "run is not there": (["fit", "nosuch.csv", "--out", "o"], "nosuch.csv: cannot be opened"),
    "run is a directory": (["fit", ".", "--out", "o"], "cannot be opened (Is a directory)"),
    "run is binary": (["fit", "binary.csv", "--out", "o"], "binary.csv"),
    "run is empty": (["fit", "empty.csv", "--out", "o"], "empty.csv"),
    "validation is not there": (
        ["fit", "a.csv", "--validation", "nosuch.csv", "--out", "o"],
        "a.csv",
    ),
    "seed is no number": (["fit", "a.csv", "--seed", "x", "--out", "o"], "'--seed'"),
    "seed has an underscore": (
        ["fit", "a.csv", "--seed", "1_0", "--out", "o"],
        "'1_0' is not an integer",
    ),
    "temperature in other digits": (
        ["fit", "a.csv", "--temperature", "\u0662\u0665", "--out", "o"],
        "'\u0662\u0665' is not a number",
    ),
    "map has a scale with an underscore": (
        ["fit", "a.csv", "--map", "current_A=x * 1_0", "--out", "o"],
        "'1_0' is not a number",
    ),
    "map has a denormal scale": (
        ["fit", "a.csv", "--map", "current_A=x * 1e-320", "--out", "o"],
        "the scale '1e-320'; expected a finite number other than 0",
    ),
    "parameter has an underscore": (
        ["feedback", "--set", "Ra25=1_0"],
        "--set Ra25: '1_0' is not a number",
    ),
    "seed is negative": (["fit", "a.csv", "--seed", "-1", "--out", "o"], "seed is -1; expected"),
    "hold is unknown": (["fit", "a.csv", "--hold", "no", "--out", "o"], "hold is 'no'; expected"),
    "controller is unknown": (
        ["fit", "a.csv", "--controller", "LQR:1", "--out", "o"],
        "controller 'LQR:1' is of unknown type; expected P:kp",
    ),
    "temperature is absurd": (
        ["fit", "a.csv", "--temperature", "1e6", "--out", "o"],
        "expected -273.15 to 400 degC",
    ),
    "temperature is no number": (
        ["fit", "a.csv", "--temperature", "hot", "--out", "o"],
        "'--temperature'",
    ),
    "map has no column": (
        ["fit", "a.csv", "--map", "current_A", "--out", "o"],
        "expected CHANNEL=",
    ),
    "map has a bad scale": (
        ["fit", "a.csv", "--map", "temperature_degC=x * two", "--out", "o"],
        "'two' is not a number",
    ),
    "map has a bad unit": (
        ["fit", "a.csv", "--map", "current_A=x in furlong", "--out", "o"],
        "furlong",
    ),
    "map has a bad channel": (["fit", "a.csv", "--map", "I=x", "--out", "o"], "'I' is no channel"),
    "mapping is not there": (["fit", "a.csv", "--mapping", "no.json", "--out", "o"], "no.json"),
    "mapping is no JSON": (["fit", "a.csv", "--mapping", "empty.csv", "--out", "o"], "not JSON"),
    "result is not there": (["predict", "no.json", "a.csv", "--out", "p.csv"], "no.json: cannot"),
    "result is no JSON": (["predict", "empty.csv", "a.csv", "--out", "p.csv"], "is not JSON"),
    "result is of another version": (
        ["predict", "future.json", "a.csv", "--out", "p.csv"],
        "schema_version 2; expected",
    ),
    "result is a list": (["feedback", "--result", "list.json"], "has schema_version None"),
    "result is binary": (["feedback", "--result", "binary.csv"], "binary.csv"),
    "neither result nor values": (["feedback"], "expected either --result"),
    "both result and values": (["feedback", "--result", "r", *MOTOR], "expected either --result"),
    "value is unknown": (["feedback", "--set", "K=1"], "--set 'K=1': expected NAME=VALUE"),
    "value is no number": (["feedback", "--set", "J=heavy"], "'heavy' is not a number"),
    "value is not finite": (["feedback", "--set", "J=inf"], "'inf' is not a number"),
    "value is there twice": (["feedback", "--set", "J=1", "--set", "J=2"], "--set J is repeated"),
    "value is missing": (["feedback", "--set", "J=1", *COLD], "no value for Ra25, Kt25, b, L"),
    "coefficients are missing": (["feedback", *MOTOR], "no value for alpha_Ra, alpha_Kt"),
    "value is negative": (["feedback", *MOTOR[:-1], "L=-1", *COLD], "L is -1 H; expected"),
    "feedback to a directory": (["feedback", *MOTOR, *COLD, "--out", "."], "is a directory"),
    "feedback below a file": (["feedback", *MOTOR, *COLD, "--out", "empty.csv/f.json"], "--out"),
    "campaign is unknown": (["demo", "nosuch"], "campaign 'nosuch' is not in data/"),
    "manifest is not there": (["batch", "no.csv", "--out", "o"], "no.csv: cannot be opened"),
    "manifest is no manifest": (["batch", "list.json", "--out", "o"], "expected the columns motor"),
    "manifest has no motor": (["batch", "none.csv", "--out", "o"], "lists no motor"),
    "manifest leads out": (["batch", "escape.csv", "--out", "o"], "row 2, column motor"),
    "manifest names a motor twice": (["batch", "twice.csv", "--out", "o"], "row 3: motor 'm' is"),
    "service to all without keys": (["serve", "--host", "0.0.0.0", "--no-auth"], "no_auth"),
    "port is out of range": (["serve", "--port", "70000"], "port"),
    "key is unknown": (["keys", "revoke", "key_x", "--data-dir", "d"], "'key_x' is no key"),
    "workspace is no name": (["keys", "create", "k", "--workspace", "A/B"], "workspace is 'A/B'"),
    "no command about keys": (["keys"], "Missing command"),
}


def failing_with(error: BaseException) -> Callable[..., NoReturn]:
    """Function that raises an error, whatever its arguments."""

    def fail(*_: object, **__: object) -> NoReturn:
        """Raise the error."""
        raise error

    return fail


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Working directory with malformed files."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.csv").touch()
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)) * 40)
    (tmp_path / "future.json").write_text('{"schema_version": 2, "parameters": {}}')
    (tmp_path / "list.json").write_text("[1, 2]")
    (tmp_path / "none.csv").write_text("motor,training\n\n")
    (tmp_path / "escape.csv").write_text("motor,training\n../up,a.csv\n")
    (tmp_path / "twice.csv").write_text("motor,training\nm,a.csv\nm,b.csv\n")
    (tmp_path / "a.csv").write_text("time_s,voltage_V\n0,1\n")
    return tmp_path


@pytest.mark.parametrize(("words", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_invalid_input_is_status_2_and_one_line(
    words: list[str], message: str, workplace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Standard error has one line with the reason; standard output is empty."""
    before = set(workplace.iterdir())

    status = main(words)

    shown, told = capsys.readouterr()
    assert (status, shown) == (2, "")
    assert told.count("\n") == 1
    assert told.startswith("motorid: ")
    assert message in told
    assert "Traceback" not in told
    left = {path.name for path in set(workplace.iterdir()) - before}
    assert left <= {"d", "motorid-data"}, "a refused call leaves nothing but a data directory"


@pytest.mark.skipif(os.geteuid() == 0 and not Path("/proc/self").exists(), reason="no such place")
def test_directory_that_cannot_be_written_is_found_before_the_fit(
    run_files: list[Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even root can write to /proc; the pipeline is not started."""
    started = failing_with(AssertionError("the fit was started"))
    monkeypatch.setattr("identification.pipeline.identify", started)

    assert main(["fit", str(run_files[0]), "--out", "/proc/motor"]) == 2

    assert "--out /proc/motor: cannot be written" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (ComputationError("no model can be simulated"), 1, "no model can be simulated"),
        (MemoryError(), 1, "not enough memory; fit fewer or shorter runs"),
        (OSError(28, "No space left on device", "r.json"), 1, "no space is left on the device"),
        (ZeroDivisionError("division by zero"), 1, "internal error, ZeroDivisionError"),
        (ComputationError("two\nlines"), 1, "two lines"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_failed_command_is_one_line_and_its_status(
    error: BaseException,
    status: int,
    line: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Computation, memory, disk and internal errors are reported without a traceback."""
    monkeypatch.delenv("MOTORID_TRACEBACK", raising=False)
    monkeypatch.setattr(motor, "motor_of", failing_with(error))

    assert main(["feedback", *MOTOR]) == status

    shown, told = capsys.readouterr()
    assert shown == ""
    assert told.startswith(f"motorid: {line}")
    assert told.count("\n") == 1


def test_traceback_is_shown_on_request(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """MOTORID_TRACEBACK=1 enables tracebacks for developers."""
    monkeypatch.setenv("MOTORID_TRACEBACK", "1")
    monkeypatch.setattr(motor, "motor_of", failing_with(ZeroDivisionError()))

    assert main(["feedback", *MOTOR]) == 1
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_failed_fit_removes_the_directory_it_made_and_no_other(
    run_files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A directory that existed before the fit remains."""
    error = ComputationError("no model can be simulated")
    monkeypatch.setattr("identification.pipeline.identify", failing_with(error))
    (tmp_path / "old").mkdir()

    for name in ("new", "old"):
        assert main(["fit", str(run_files[0]), "--out", str(tmp_path / name), "-q"]) == 1

    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_exit_statuses_are_those_of_the_contract() -> None:
    """The statuses are 0, 1, 2, and 128 plus the number of each of three signals."""
    assert {0, *EXIT_STATUS.values()} == {0, 1, 2, 129, 130, 143}


def shell(*words: str) -> subprocess.Popen[str]:
    """Start the command in a separate process."""
    return subprocess.Popen(
        [sys.executable, "-c", "import sys; from app.cli import main; sys.exit(main())", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )


def test_closed_output_pipe_is_status_1_and_one_line() -> None:
    """In `motorid ... | head -0` the pipe is closed before the output."""
    process = shell("feedback", *MOTOR, *COLD, "--json")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()

    status = process.wait(60)

    told = process.stderr.read()
    process.stderr.close()
    assert (status, told) == (1, "motorid: the reader closed the output pipe\n")


class Finalized:
    """Object during whose finalizer the user presses Ctrl-C."""

    def __del__(self) -> None:
        """Python prints what is raised here, and goes on."""
        signal.raise_signal(signal.SIGINT)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_interruption_of_a_finalizer_is_not_lost() -> None:
    """The next progress of the fit raises it again."""
    with raised_signals(), progress_bar(quiet=True) as progress:
        progress("fit", 0.1)
        Finalized()
        with pytest.raises(KeyboardInterrupt):
            progress("fit", 0.2)


def test_interrupted_fit_is_status_130_and_one_line(run_files: list[Path], tmp_path: Path) -> None:
    """SIGINT during a fit that would otherwise take seconds ends it and removes its directory."""
    process = shell("fit", *map(str, run_files), "--out", str(tmp_path / "out"))
    while not (tmp_path / "out").exists():
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(0.1)

    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)

    assert (process.returncode, told) == (130, "motorid: interrupted\n")
    assert not (tmp_path / "out").exists()


def test_refusal_names_row_and_column(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An invalid cell in line 42 is reported as row 42; the header is row 1."""
    lines = run_files[0].read_text(encoding="utf-8").splitlines()
    cells = lines[41].split(",")
    cells[lines[0].split(",").index("current_A")] = "n/a"
    lines[41] = ",".join(cells)
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

    assert main(["fit", str(tmp_path / "run.csv"), "--out", str(tmp_path / "o")]) == 2

    assert "run.csv, row 42, column current_A" in capsys.readouterr().err


def test_feedback_list_is_replaced_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the disk is full, the old file remains and no temporary file is left."""
    out = tmp_path / "feedback.json"
    out.write_text("old")

    full = failing_with(OSError(28, "No space left on device"))
    monkeypatch.setattr("identification.result.atomic.sync", full)

    assert main(["feedback", *MOTOR, *COLD, "--out", str(out), "-q"]) == 1
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"feedback.json": "old"}

    monkeypatch.undo()
    assert main(["feedback", *MOTOR, *COLD, "--out", str(out), "-q"]) == 0
    assert json.loads(out.read_text())[0]["temperature_degC"] == 25.0


@pytest.mark.parametrize("command", ["predict", "feedback"])
def test_result_that_is_a_pipe_is_not_waited_for(
    run_files: list[Path], tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Reading a pipe without a writer would block forever."""
    pipe = tmp_path / "result.json"
    os.mkfifo(pipe)
    out = ["--out", str(tmp_path / "out")]
    words = [str(pipe), str(run_files[0])] if command == "predict" else ["--result", str(pipe)]

    assert main([command, *words, *out]) == 2
    assert f"{pipe}: cannot be opened (Not a regular file)" in capsys.readouterr().err


class _Interrupted:
    """Object during whose end a Ctrl-C arrives."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


def test_a_signal_in_a_finalizer_is_raised_afterwards_without_a_traceback(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python ignores the exception there, and would print it."""
    monkeypatch.setattr(sys, "unraisablehook", sys.__unraisablehook__)
    with raised_signals():
        _Interrupted()
        with pytest.raises(KeyboardInterrupt):
            raise_missed()

    assert capsys.readouterr() == ("", "")
