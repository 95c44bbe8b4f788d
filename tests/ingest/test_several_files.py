"""Files of one channel each, joined to one run."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from app.commands.arguments import mapping_of
from identification.errors import InputError, MissingValue
from identification.ingest import Run
from identification.ingest.several_files import join_files
from tests.ingest.samples import channels
from tests.ingest.scopes import SIDES, beside
from tests.ingest.writers import RECORD

TIME = 1e-3 * np.arange(400)
VOLTAGE = 12.0 * np.sign(np.sin(40.0 * TIME))
CURRENT = 2.0 * np.sin(40.0 * TIME)
SPEED = 100.0 * np.cos(40.0 * TIME)
PROBES = ["voltage_V=CH1", "current_A=CH2 * 10", "speed_rad_s=CH3 * 50"]


def written(path: Path, header: str, *columns: np.ndarray, end: str = "") -> Path:
    """Write a table; each line ends with `end`."""
    rows = [",".join(map(repr, row)) + end for row in np.column_stack(columns).tolist()]
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


def oscilloscope(directory: Path, form: str) -> list[Path]:
    """Three files of volts: of Tektronix, of Rigol with fewer cells than names, or of LeCroy."""
    files = []
    for number, values in enumerate((VOLTAGE, CURRENT / 10.0, SPEED / 50.0), start=1):
        path = directory / f"C{number}.csv"
        head, first = {
            "tektronix": (f"Horizontal Units,s\nVertical Units,V\nTIME,CH{number}", TIME),
            "rigol": (f"X,CH{number},Start,Increment,\nSequence,Volt,0,1e-3", np.arange(400)),
            "lecroy": ("Time,Ampl", TIME),
        }[form]
        files.append(written(path, head, first, values, end="," * (form == "rigol")))
    return files


def joined(files: list[Path], *settings: str) -> Run:
    """Joined run with the mapping of the command line."""
    return join_files(files, "run.csv", mapping_of(None, settings))


@pytest.mark.parametrize("form", ["tektronix", "rigol", "lecroy"])
def test_files_of_an_oscilloscope_are_one_run(tmp_path: Path, form: str) -> None:
    """The samples are those of the files, times the gains of the probes."""
    titles = {"tektronix": "CH{}", "rigol": "CH{}", "lecroy": "C{}.csv/Ampl"}[form]
    settings = [one.replace(f"CH{k}", titles.format(k)) for k, one in enumerate(PROBES, 1)]
    settings += ["time_s=Time in s"] if form == "lecroy" else []

    run = joined(oscilloscope(tmp_path, form), *settings)

    np.testing.assert_allclose(run.time, TIME, atol=1e-15)
    np.testing.assert_array_equal(run.voltage, VOLTAGE)
    np.testing.assert_allclose(run.current, CURRENT, rtol=1e-12)
    np.testing.assert_allclose(run.speed, SPEED, rtol=1e-12)
    assert "different_clocks" not in [warning.code for warning in run.warnings]


@pytest.mark.parametrize("end", ["", ","])
@pytest.mark.parametrize("settings", SIDES.values(), ids=SIDES)
def test_settings_beside_the_samples_are_no_samples(
    tmp_path: Path, settings: tuple[str, ...], end: str
) -> None:
    """A file of Tektronix for each channel; reference: the record, from its first sample on."""
    files = [beside(tmp_path / f"F{k}.CSV", k, settings, end) for k in (1, 2, 3)]
    title = "CH{}" if "Source" in "".join(settings) else "F{}"

    run = joined(
        files,
        *(f"{name}={title.format(k)} in {unit}" for k, (name, unit) in enumerate(
            (("voltage_V", "V"), ("current_A", "A"), ("speed_rad_s", "rad/s")), 1)),
    )  # fmt: skip

    for name in ("time_s", "voltage_V", "current_A", "speed_rad_s"):
        np.testing.assert_array_equal(channels(run)[name], RECORD[name])
    probes = [w.message for w in run.warnings if w.code == "probe_attenuation"]
    assert len(probes) == (3 if "CH" in title else 0)
    assert all("a probe attenuation of 10, by which the device has multiplied" in p for p in probes)
    said = "the probe attenuation is in the cells of CH1 (by 10), CH2" if probes else "'F1', 'F2'"
    with pytest.raises(InputError, match=re.escape(said)):
        joined(files)


def test_damaged_first_sample_is_no_header(tmp_path: Path) -> None:
    """Settings of Tektronix stand in its line; in a German file with decimal commas."""
    files = [beside(tmp_path / f"F{k}.CSV", k, SIDES["settings with a source"]) for k in (1, 2, 3)]
    for file in files:
        file.write_text(file.read_text().replace(",", ";").replace(".", ","))
    first, *rest = files[0].read_text().split("\n")
    settings = ["voltage_V=CH1 * 1", "current_A=CH2 * 1", "speed_rad_s=CH3 * 1"]

    run = joined(files, *settings)
    files[0].write_text("\n".join([first.rpartition(";")[0] + ";---", *rest]))

    assert sum(w.code == "probe_attenuation" for w in run.warnings) == 3
    with pytest.raises(InputError, match="F1.CSV, row 1, column CH1: '---' is not a number"):
        joined(files, *settings)


def test_all_that_is_missing_is_said_at_once(tmp_path: Path) -> None:
    """Files of LeCroy have neither a unit of the time nor names or units of the channels."""
    with pytest.raises(InputError) as caught:
        joined(oscilloscope(tmp_path, "lecroy"), "voltage_V=C1.csv/Ampl")

    messages = [caught.value.message, *(one.message for one in caught.value.further)]
    assert len(messages) == 2
    assert "may be time_s, but has no unit" in messages[0]
    assert "'C2.csv/Ampl', 'C3.csv/Ampl' without a unit have no name of a channel" in messages[1]


def test_channels_with_clocks_of_their_own_follow_the_voltage(tmp_path: Path) -> None:
    """The speed is logged in ms at a fifth of the rate; it is linear between its samples."""
    files = [
        written(tmp_path / "u.csv", "t [s],voltage [V]", TIME, VOLTAGE),
        written(tmp_path / "i.csv", "t [s],current [mA]", TIME, 1e3 * CURRENT),
        written(tmp_path / "n.csv", "t [ms],speed [rad/s]", 1e3 * TIME[::5], SPEED[::5]),
    ]

    run = joined(files)

    np.testing.assert_array_equal(run.time, TIME[:396])
    np.testing.assert_allclose(run.current, CURRENT[:396], rtol=1e-12)
    np.testing.assert_allclose(run.speed, np.interp(TIME[:396], TIME[::5], SPEED[::5]))
    (note,) = (w.message for w in run.warnings if w.code == "different_clocks")
    assert "speed [rad/s] (0.005 s) is interpolated linearly" in note


def test_files_that_are_no_single_recording_are_refused(tmp_path: Path) -> None:
    """A file twice, a channel of two recordings, a shorter recording, and one file alone."""
    first, second, third = oscilloscope(tmp_path, "tektronix")
    copy = tmp_path / "copy.csv"
    copy.write_bytes(first.read_bytes())
    again = written(tmp_path / "again.csv", "TIME [s],CH1", TIME, -VOLTAGE)
    short = written(tmp_path / "short.csv", "TIME [s],CH3", TIME[:200], SPEED[:200])

    for files, message in (
        ([first, second, copy], "C1.csv and copy.csv have the same content"),
        ([first, second, again], "C1.csv and again.csv both have the channel 'CH1'"),
        ([first, second, short], "short.csv: lasts 0.199 s, and C1.csv 0.399 s"),
        ([first], "one file has nothing to be joined with"),
    ):
        with pytest.raises(InputError, match=message):
            joined(files, *PROBES)
    with pytest.raises(InputError, match=r"'CH1', 'CH2', 'CH3' in V have no name"):
        joined([first, second, third])


def test_two_devices_with_clocks_of_their_own_are_aligned(tmp_path: Path) -> None:
    """The logger was started 5.2 s before the oscilloscope; the offset brings the channels back."""
    scope = written(tmp_path / "scope.csv", "TIME [s],CH1,CH2", TIME, VOLTAGE, CURRENT / 10.0)
    late, longer = TIME + 5.2, np.arange(-0.1, 0.5, 1e-3)
    same = written(tmp_path / "same.csv", "t [ms],n [rad/s]", 1e3 * late, SPEED)
    speed = 100.0 * np.cos(40.0 * longer)
    logger = written(tmp_path / "logger.csv", "t [ms],n [rad/s]", 1e3 * (longer + 5.2), speed)

    for file, message in (
        (same, "same.csv: begins at 5.2 s, and scope.csv at 0 s; .* 'same.csv:time_s=HEADER"),
        (logger, "scope.csv: lasts 0.399 s, and logger.csv 0.599 s"),
    ):
        with pytest.raises(InputError, match=message):
            joined([scope, file], *PROBES[:2])
        run = joined([scope, file], *PROBES[:2], f"{file.name}:time_s=t [ms] + -5200 in ms")
        np.testing.assert_allclose(run.speed, 100.0 * np.cos(40.0 * run.time), atol=1e-6)
        assert run.time.size > 390
    with pytest.raises(InputError, match=r"expected time_s alone.* logger\.csv/HEADER"):
        joined([scope, logger], *PROBES[:2], "logger.csv:speed_rad_s=n [rad/s]")


def test_files_with_one_name_are_told_apart_by_their_position(tmp_path: Path) -> None:
    """Loggers that write one directory for each channel."""
    files = []
    for number, values in enumerate((VOLTAGE, CURRENT, SPEED), start=1):
        (tmp_path / f"{number}").mkdir()
        files.append(written(tmp_path / f"{number}" / "log.csv", "t [s],value", TIME, values))

    run = joined(
        files,
        *(f"{name}={k}/log.csv/value" for k, name in
          enumerate(("voltage_V", "current_A", "speed_rad_s"), 1)),
    )  # fmt: skip

    np.testing.assert_array_equal(run.speed, SPEED)


def test_group_of_columns_with_an_unknown_time_is_refused(tmp_path: Path) -> None:
    """The current was logged at half the rate, at times under a title that says nothing."""
    drive = tmp_path / "drive.csv"
    head = "Time [s],Voltage [V],abscissa,Current [A]"
    half = np.where(np.arange(400) < 200, CURRENT[np.minimum(2 * np.arange(400), 399)], np.nan)
    written(drive, head, TIME, VOLTAGE, 2.0 * TIME, half)
    drive.write_text(drive.read_text().replace("nan", ""))
    speed = written(tmp_path / "speed.csv", "Time [s],Speed [rad/s]", TIME, SPEED)

    with pytest.raises(MissingValue, match="drive.csv, row 202, .* only the first 200 of 400 rows"):
        joined([drive, speed])
