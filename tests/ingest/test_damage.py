"""Damaged run files: a named error, or a warning that says what is missing."""

from __future__ import annotations

import functools
import gzip
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import errors
from identification.ingest import Run, read_run
from identification.ingest.formats.library import decoding
from tests.ingest.devices import YOKOGAWA, lvm, text
from tests.ingest.samples import channels
from tests.ingest.specimens import SPECIMENS
from tests.ingest.writers import CHANNELS, RECORD, TIME, Specimen, datasets, hdf5, rows, tdms

BINARY = [
    specimen
    for specimen in SPECIMENS
    if specimen.name
    in ("units.h5", "run.mf4", "run.mdf", "run.parquet", "run.tdms.gz", "time.tdms", "run.xlsx")
]


@functools.cache
def content(specimen: Specimen) -> bytes:
    """Bytes of a valid file."""
    with tempfile.TemporaryDirectory() as folder:
        return specimen.made(Path(folder)).read_bytes()


def run_or_error(path: Path) -> Run | errors.RunFileError:
    """Return the run or the reading error; any other exception is raised."""
    try:
        return read_run(path)
    except errors.RunFileError as error:
        return error


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("run.lvm", lvm("One")),
        ("run.lvm", lvm("Multi")),
        ("run.csv", text(YOKOGAWA, [[None, *row[1:]] for row in rows()])),
    ],
)
@pytest.mark.parametrize("lost", [1, 17, 30])
def test_table_with_fewer_samples_than_its_device_states_is_read_with_a_warning(
    tmp_path: Path, name: str, table: str, lost: int
) -> None:
    """The header states 40 samples; the last ones are cut off at the end of a line."""
    path = tmp_path / name
    path.write_bytes(b"".join(table.encode().splitlines(keepends=True)[:-lost]))

    run = read_run(path)

    assert run.rows == 40 - lost
    [warning] = [w for w in run.warnings if w.code == "incomplete_file"]
    assert f"{40 - lost} samples, and the header states 40" in warning.message


def test_unused_channels_of_labview_may_have_any_clock(tmp_path: Path) -> None:
    """A channel without samples has an interval of 1 s and blank cells."""
    unused = {"Samples": "0", "Delta_X": "1.000000", "X_Value": "Untitled", "Y_Unit_Label": ""}
    lines = []
    for line in lvm("One").replace("Channels\t4", "Channels\t5").split("\r\n"):
        key, *cells = line.split("\t")
        is_sample = len(cells) == 4 and key[0].isdigit()
        if key in unused or is_sample:
            cells.insert(1, unused.get(key, ""))
        lines.append("\t".join([key, *cells]))
    path = tmp_path / "run.lvm"
    path.write_text("\n".join(lines))

    assert read_run(path).rows == 40


def test_segments_of_labview_with_other_channels_are_not_joined(tmp_path: Path) -> None:
    """The message names the columns of both."""
    path = tmp_path / "run.lvm"
    path.write_text(lvm("One") + lvm("One").replace("Current", "Torque"))

    with pytest.raises(errors.UnsupportedContent, match="'Torque'.*and the first one has.*'Curr"):
        read_run(path)


def test_column_named_samples_is_no_count(tmp_path: Path) -> None:
    """The first cell of the header row is a name here, and its neighbour is not a number."""
    path = tmp_path / "run.csv"
    lines = [",".join(["samples", *RECORD]), *(f"7,{','.join(map(str, row))}" for row in rows())]
    path.write_text("\n".join(lines) + "\n")

    run = read_run(path)

    assert {w.code for w in run.warnings} == {"unused_columns"}


def test_heap_of_hdf5_with_free_space_of_size_zero_is_refused(tmp_path: Path) -> None:
    """The unit of a channel is a text in a global heap; HDF5 1.14 walks over zeros for ever."""
    path = tmp_path / "run.h5"
    hdf5(path, lambda file: datasets(file, CHANNELS))
    damaged = bytearray(path.read_bytes())
    heap = damaged.index(b"GCOL")
    damaged[heap + 16 : heap + 4096] = bytes(4096 - 16)
    path.write_bytes(damaged)

    with pytest.raises(errors.DamagedFile, match=f"the global heap at byte {heap} is damaged"):
        read_run(path)


def test_flipped_bit_in_parquet_with_checksums_is_refused(tmp_path: Path) -> None:
    """One bit of the samples changes a number; only the checksum of the page shows it."""
    pytest.importorskip("pyarrow")
    import pyarrow
    from pyarrow import parquet

    path = tmp_path / "run.parquet"
    table = pyarrow.table(RECORD)
    parquet.write_table(
        table, path, compression="none", use_dictionary=False, write_page_checksum=True
    )
    damaged = bytearray(path.read_bytes())
    damaged[damaged.index(RECORD["current_A"].tobytes()) + 9] ^= 16
    path.write_bytes(damaged)

    with pytest.raises(errors.DamagedFile, match="this looks like a Parquet file"):
        read_run(path)


def test_sizes_that_do_not_fit_into_the_memory_are_a_fault_of_the_file() -> None:
    """A library asked for the memory that a damaged file declares."""
    with pytest.raises(errors.OutOfMemory, match="a TDMS file.*needs more memory than there is"):
        with decoding("a TDMS file"):
            raise MemoryError


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("/var/lib/motorid/files 1/ab/run.mf4 is no valid file", "(run.mf4 is no valid file)"),
        (r"cannot open 'C:\Users\max\run.mf4'", "(cannot open 'run.mf4')"),
        ("a speed in rad/s, a slope in m/s", "(a speed in rad/s, a slope in m/s)"),
    ],
)
def test_error_of_a_library_shows_no_folders(said: str, told: str) -> None:
    """Someone who uploads a file learns nothing of the folders of the service."""
    with pytest.raises(errors.DamagedFile, match=re.escape(told)):
        with decoding("an MDF file"):
            raise ValueError(said)


def test_cut_binary_file_is_never_read_as_whole(tmp_path: Path) -> None:
    """Each format knows its length: at every cut there is an error or a warning."""
    for specimen in BINARY:
        whole = content(specimen)
        path = tmp_path / specimen.name
        for share in (0.3, 0.9):
            path.write_bytes(whole[: int(share * len(whole))])
            outcome = run_or_error(path)
            if isinstance(outcome, Run):
                codes = {warning.code for warning in outcome.warnings}
                assert "incomplete_file" in codes, (specimen.name, share)


@st.composite
def damaged(draw: st.DrawFn) -> tuple[Specimen, bytes]:
    """A valid binary file with parts cut off, zeroed, repeated or replaced by large numbers."""
    specimen = draw(st.sampled_from(BINARY))
    file = bytearray(content(specimen))
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(file)))
        end = min(len(file), at + draw(st.sampled_from([1, 4, 8, 64, 600])))
        large = draw(st.sampled_from([2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1]))
        file[at:end] = draw(
            st.sampled_from([b"", bytes(end - at), file[at:end] * 2, large.to_bytes(8, "little")])
        )
    return specimen, bytes(file)


@settings(deadline=None, max_examples=60, derandomize=True)
@given(case=damaged())
def test_damaged_binary_file_gives_a_run_or_a_named_error(case: tuple[Specimen, bytes]) -> None:
    """Any content gives a valid run or an error whose message is one line with the file name."""
    specimen, file = case
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / specimen.name
        path.write_bytes(file)
        outcome = run_or_error(path)

    if isinstance(outcome, errors.RunFileError):
        assert outcome.code != errors.RunFileError.code
        assert str(outcome).isprintable()
        assert outcome.file == specimen.name
    else:
        assert np.all(np.diff(outcome.time) > 0.0)
        assert all(np.all(np.isfinite(values)) for values in channels(outcome).values())


def test_clock_that_is_not_finite_is_refused_with_its_sample(tmp_path: Path) -> None:
    """The channels share one clock, so none of them lies outside of the time of another."""
    pytest.importorskip("nptdms")
    path = tmp_path / "run.tdms"
    time = np.where(np.arange(40) == 6, np.nan, TIME[2])
    groups = {name: [("time", "s", time), (name, unit, v)] for name, unit, v in CHANNELS[1:]}
    tdms(path, groups, {})

    with pytest.raises(errors.MissingValue, match="row 7, column time: the cell is blank"):
        read_run(path)


def test_compressed_file_that_is_cut_or_flipped_is_refused(tmp_path: Path) -> None:
    """The gzip format has a checksum of the content, so no damage of it is read as samples."""
    whole = gzip.compress(
        text(("time_s,voltage_V,current_A,speed_rad_s",), [r[:4] for r in rows()]).encode()
    )
    path = tmp_path / "run.csv.gz"
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 1
    for damage in (whole[:-1], whole[: len(whole) // 2], bytes(flipped)):
        path.write_bytes(damage)
        with pytest.raises(errors.RunFileError):
            read_run(path)
