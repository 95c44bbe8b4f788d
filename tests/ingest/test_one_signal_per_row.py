"""Tables of time, name, value and unit in any format, as databases and buses export them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest

from identification import errors
from identification.ingest import read_run
from tests.ingest.samples import record

RECORD = record(60)
TIME = RECORD["time_s"]
UNITS = {"Voltage": "V", "Current": "A", "Speed": "rad/s"}


def signals(**columns: Any) -> pd.DataFrame:
    """The record with one signal per row, the speed at every second time, and a state."""
    steps = {"Voltage": 1, "Current": 1, "Speed": 2}
    parts = [
        pd.DataFrame({"time": TIME[::step], "tag": name, "value": cells[::step], "unit": unit})
        for (name, unit), step, cells in zip(
            UNITS.items(), steps.values(), list(RECORD.values())[1:4], strict=True
        )
    ]
    state = pd.DataFrame({"time": [0.0], "tag": ["State"], "value": [1.0], "unit": [""]})
    return pd.concat([*parts, state]).sort_values("time").reset_index(drop=True).assign(**columns)


def hdf5(path: Path, frame: pd.DataFrame) -> None:
    """Write a dataset for each column."""
    with h5py.File(path, "w") as file:
        for name in frame:
            cells = frame[name]
            file[str(name)] = cells.to_list() if cells.dtype.kind == "O" else cells.to_numpy()


def compound(path: Path, frame: pd.DataFrame) -> None:
    """Write one compound dataset with texts of fixed length."""
    with h5py.File(path, "w") as file:
        kinds = {"tag": "S10", "unit": "S10"}
        file["log"] = frame.to_records(index=False, column_dtypes=kinds)


NUMBERS = signals().rename(columns={"time": "time_s"})
START = pd.Timestamp("2026-03-01 23:59:59.97", tz="Europe/Berlin")
DATES = pd.Series(START + pd.to_timedelta(np.round(NUMBERS["time_s"] * 1e6), unit="us"))
NANOSECONDS = DATES.dt.tz_convert(None).astype("datetime64[ns]").astype("int64")
FRAMES = {
    "seconds": NUMBERS,
    "dates": signals(time=DATES),
    "nanoseconds since 1970": signals(time=NANOSECONDS).rename(columns={"time": "time [ns]"}),
    "texts": signals(
        time=DATES.dt.strftime("%Y-%m-%d %H:%M:%S.%f"),
        value=[
            "on" if tag == "State" else repr(x)
            for tag, x in zip(NUMBERS.tag, NUMBERS.value, strict=True)
        ],
    ),
}


@pytest.mark.parametrize("ending", ["csv", "parquet", "frame", "h5", "compound"])
@pytest.mark.parametrize("form", FRAMES)
def test_signals_are_channels_in_any_format(tmp_path: Path, form: str, ending: str) -> None:
    """The same rows, whose names are texts and whose times have any form the format can hold."""
    if ending in ("h5", "compound") and form in ("dates", "texts"):
        form = "seconds"
    frame, path = FRAMES[form], tmp_path / f"run.{ending}"
    write = {
        "csv": lambda: frame.to_csv(path, index=False),
        "parquet": lambda: frame.to_parquet(path),
        "h5": lambda: hdf5(path, frame),
        "compound": lambda: compound(path, frame),
    }
    write.get(ending, lambda: None)()

    run = read_run(frame if ending == "frame" else path)

    assert np.array_equal(run.voltage, RECORD["voltage_V"][:59])
    assert np.array_equal(run.current, RECORD["current_A"][:59])
    speed = np.interp(TIME[:59], TIME[::2], RECORD["speed_rad_s"][::2])
    assert run.speed == pytest.approx(speed, rel=1e-9)
    assert run.time - run.time[0] == pytest.approx(TIME[:59], abs=1e-9)
    assert run.sources["speed_rad_s"].method == "linear"


def test_frames_of_different_signals_have_different_digests() -> None:
    """The digest covers names and values."""
    other = NUMBERS.assign(value=NUMBERS["value"] * 2.0)

    assert read_run(NUMBERS).sha256 != read_run(other).sha256


def test_fault_of_a_signal_has_its_row() -> None:
    """Rows of a DataFrame are counted from 0."""
    frame = NUMBERS.astype({"value": object})
    at = int(np.flatnonzero(frame["tag"] == "Current")[7])
    frame.loc[at, "value"] = "overflow"

    with pytest.raises(errors.NotANumber, match=f"row {at}, column Current: 'overflow'"):
        read_run(frame)


def test_table_without_rows_is_refused() -> None:
    """A query of a database found nothing."""
    with pytest.raises(errors.NoRows, match="no row below the header"):
        read_run(NUMBERS[:0])
