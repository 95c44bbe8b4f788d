"""Properties of the reader for all files: written values are read, other outcomes are errors."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.errors import RunFileError
from identification.ingest import Run, read_run, write_run
from identification.ingest.names import NAMES
from identification.ingest.text import samples
from identification.ingest.text.fast import read_clean
from identification.ingest.units import CHANNEL_QUANTITIES, UNITS, Unit
from tests.ingest.samples import Dialect, channels, record, write

Array = NDArray[np.float64]

LARGEST = {
    "voltage_V": 900.0,
    "current_A": 900.0,
    "speed_rad_s": 900.0,
    "temperature_degC": 190.0,
    "position_rad": 900.0,
}


@st.composite
def runs(draw: st.DrawFn) -> dict[str, Array]:
    """Values of a valid run in SI units, over nine decades up to the largest permitted."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows = draw(st.integers(10, 40))
    steps = random.uniform(1e-4, 1e-3, rows - 1)
    values = {"time_s": np.concatenate(([draw(st.floats(-5.0, 5.0))], steps)).cumsum()}
    for name in [*LARGEST][: draw(st.integers(3, 5))]:
        sizes = LARGEST[name] * 10.0 ** -random.uniform(0.0, 9.0, rows)
        values[name] = sizes * random.choice([-0.25, 0.0, 1.0], rows)
        values[name][random.integers(rows)] = draw(st.floats(0.0, 100.0))
    if "temperature_degC" in values:
        # One sample at 20 degC: a run entirely above 250 would be interpreted as kelvin.
        values["temperature_degC"][0] = 20.0
    if "position_rad" in values:
        # The position does not follow the speed; a constant is not compared with it.
        values["position_rad"][:] = values["position_rad"][0]
    return values


@st.composite
def headers(draw: st.DrawFn, channel: str) -> tuple[str, Unit]:
    """A header that names a channel and its unit, and that unit."""
    quantity = CHANNEL_QUANTITIES[channel]
    unit = draw(st.sampled_from([unit for unit in UNITS if unit.quantity == quantity]))
    if unit.factor == 1.0 and unit.shift == 0.0 and draw(st.booleans()):
        return channel, unit
    name = draw(st.sampled_from(NAMES[quantity]))
    spelling = draw(st.sampled_from(unit.spellings))
    form = draw(st.sampled_from(["{} [{}]", "{} ({})", "{}/{}", "{} in {}", "{}_{}", "{}, {}"]))
    return form.format(name, spelling), unit


@st.composite
def dialects(draw: st.DrawFn) -> Dialect:
    """Any accepted format of a table."""
    delimiter = draw(st.sampled_from([",", ";", "\t"]))
    return Dialect(
        delimiter=delimiter,
        decimal="." if delimiter == "," else draw(st.sampled_from([".", ","])),
        newline=draw(st.sampled_from(["\n", "\r\n", "\r"])),
        encoding=draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])),
        quote=draw(st.sampled_from(["", '"'])),
        trailing=draw(st.booleans()),
        above=draw(st.sampled_from([(), ("# bench 3",), ("Model,X1", "", "Points,9"), ("title",)])),
        blank_lines_below=draw(st.integers(0, 2)),
    )


def read_bytes(content: bytes) -> Run:
    """Read content as a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        path.write_bytes(content)
        return read_run(path)


def run_or_error(content: bytes) -> Run | RunFileError:
    """Return the run or the reading error; any other exception is raised."""
    try:
        return read_bytes(content)
    except RunFileError as error:
        return error


@settings(deadline=None, max_examples=80)
@given(values=runs(), dialect=dialects(), data=st.data())
def test_run_written_in_any_dialect_and_units_reads_back_in_si(
    values: dict[str, Array], dialect: Dialect, data: st.DataObject
) -> None:
    """Reference: the written numbers, converted with the factor of their unit."""
    written = {}
    for channel, column in values.items():
        header, unit = data.draw(headers(channel))
        if dialect.delimiter in header and not dialect.quote:
            header = f'"{header}"'
        written[header] = column / unit.factor - unit.shift
    content = write(written, dialect)

    run = channels(read_bytes(content))

    assert set(run) == set(values)
    for channel, column in values.items():
        np.testing.assert_allclose(run[channel], column, rtol=1e-12, atol=1e-10)


@settings(deadline=None, max_examples=100)
@given(values=runs())
def test_canonical_file_reads_back_bit_for_bit(values: dict[str, Array]) -> None:
    """Reference: the written numbers; canonical files need no arithmetic."""
    run = Run(
        name="run.csv",
        sha256="",
        time=values["time_s"],
        voltage=values["voltage_V"],
        current=values["current_A"],
        speed=values["speed_rad_s"],
        temperature=values.get("temperature_degC"),
        position=values.get("position_rad"),
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"

        write_run(run, path)
        again = channels(read_run(path))

    for name, column in channels(run).items():
        assert np.array_equal(column, again[name]), name


VALID = write(record(12))
TOKENS = [
    *(b"time_s", b"voltage_V", b"speed [rpm]", b"i [mA]", b"\xb0C", b"#", b"(", b"["),
    *(b"1", b"0.5", b"1,5", b"-2e3", b"1e999", b"nan"),
    *(b",", b";", b"\t", b" ", b"\n", b"\r", b'"', b"\x00"),
]


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A valid file with pieces removed, inserted or replaced."""
    content = bytearray(VALID)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        end = min(len(content), at + draw(st.integers(0, 30)))
        content[at:end] = draw(st.one_of(st.binary(max_size=8), st.sampled_from(TOKENS)))
    return bytes(content)


@settings(deadline=None, max_examples=250)
@given(
    content=st.one_of(
        st.binary(max_size=300),
        damaged(),
        st.lists(st.sampled_from(TOKENS), max_size=120).map(b"".join),
    )
)
@example(content=b"\xff\xfe\x31")
@example(content=b"\xef\xbb\xbf")
def test_any_bytes_give_a_run_or_a_named_error(content: bytes) -> None:
    """Any content gives a valid run or a named error whose message is one line."""
    outcome = run_or_error(content)

    if isinstance(outcome, RunFileError):
        assert outcome.code != RunFileError.code
        assert str(outcome).isprintable()
        assert outcome.file == "run.csv"
    else:
        assert outcome.rows >= 10
        assert np.all(np.diff(outcome.time) > 0.0)
        assert all(np.all(np.isfinite(values)) for values in channels(outcome).values())


@settings(deadline=None, max_examples=100)
@given(content=damaged())
def test_fast_and_slow_reader_agree_on_damaged_files(content: bytes) -> None:
    """Both readers give the same run or the same error."""
    outcomes = []
    for fast in (read_clean, lambda *_: None):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(samples, "read_clean", fast)
            outcome = run_or_error(content)
        if isinstance(outcome, RunFileError):
            outcomes.append(str(outcome))
        else:
            values = {name: column.tobytes() for name, column in channels(outcome).items()}
            outcomes.append(repr((outcome.warnings, outcome.segments, values)))

    assert outcomes[0] == outcomes[1]


def test_file_cut_anywhere_near_its_end_never_gains_a_wrong_sample(tmp_path: Path) -> None:
    """Reference: the samples of the whole file; a lost last digit changes less than 1e-5."""
    whole = channels(read_bytes(VALID))
    path = tmp_path / "cut.csv"

    for lost in range(1, 60):
        path.write_bytes(VALID[:-lost])
        run = read_run(path)

        assert run.rows >= 10, lost
        for name, values in channels(run).items():
            assert np.array_equal(values[:-1], whole[name][: run.rows - 1]), (lost, name)
            assert abs(values[-1] - whole[name][run.rows - 1]) < 1e-5, (lost, name)
