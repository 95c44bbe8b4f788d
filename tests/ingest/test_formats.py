"""Binary and compressed run files: read to the last digit, or refused with every fault."""

from __future__ import annotations

import gzip
import hashlib
import sys
from pathlib import Path

import numpy as np
import pytest

from identification import errors
from identification.ingest import Limits, read_run
from tests.ingest.broken_formats import BROKEN
from tests.ingest.samples import channels, write
from tests.ingest.specimens import SPECIMENS
from tests.ingest.writers import RECORD, BrokenSpecimen, Specimen


@pytest.mark.parametrize("specimen", SPECIMENS, ids=lambda s: f"{s.name} {s.title}")
def test_every_format_is_read_to_the_last_digit(tmp_path: Path, specimen: Specimen) -> None:
    """The file was written by the format's own library from the record."""
    path = specimen.made(tmp_path)

    run = read_run(path, mapping=specimen.mapping)

    found = channels(run)
    assert list(found) == list(RECORD)
    for name, values in RECORD.items():
        if name == "time_s" and specimen.is_clock_implied:
            np.testing.assert_allclose(found[name], values, rtol=1e-15)
        else:
            assert np.array_equal(found[name], values), name
    assert run.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("broken", BROKEN, ids=lambda b: f"{b.file.name} {b.file.title}")
def test_broken_file_of_every_format_is_refused_in_one_message(
    tmp_path: Path, broken: BrokenSpecimen
) -> None:
    """One fault or several are put into a valid file; the message names each of them."""
    path = broken.file.made(tmp_path)

    with pytest.raises(broken.error) as caught:
        read_run(path, mapping=broken.file.mapping)

    text = str(caught.value)
    assert text.startswith(broken.file.name)
    assert [words for words in broken.words if words not in text] == []
    assert text.isprintable()
    assert len(text) < 1500


@pytest.mark.parametrize(
    ("module", "name", "head"),
    [
        ("python_calamine", "run.xlsx", b"PK\x03\x04" + bytes(26) + b"xl/workbook.xml"),
        ("pyarrow.parquet", "run.parquet", b"PAR1"),
        ("nptdms", "run.tdms", b"TDSm"),
        ("asammdf", "run.mf4", b"MDF     4.10"),
    ],
)
def test_missing_library_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, name: str, head: bytes
) -> None:
    """The import of the library fails as if it were not installed."""
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / name
    path.write_bytes(head + bytes(100))

    with pytest.raises(errors.MissingLibrary, match=r"pip install 'motorid\[formats\]'"):
        read_run(path)


def test_compressed_bomb_is_refused_at_the_limit(tmp_path: Path) -> None:
    """Three megabytes of blank lines take three kilobytes; the limit counts unpacked bytes."""
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(write(RECORD) + b"\n" * 3_000_000))

    with pytest.raises(errors.FileTooLarge, match="more than the limit of 2000000"):
        read_run(path, limits=Limits(bytes=2_000_000))
