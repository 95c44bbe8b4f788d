"""Refused files: each with its own error class, row and column, on one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification import errors
from identification.ingest import Limits, read_run
from tests.ingest.broken_tables import BROKEN_TABLES, Refusal
from tests.ingest.broken_values import BROKEN_VALUES
from tests.ingest.samples import record, write

FILES = (*BROKEN_TABLES, *BROKEN_VALUES)


@pytest.mark.parametrize("refusal", FILES, ids=lambda refusal: refusal.title.replace(" ", "-"))
def test_broken_file_is_refused_with_its_named_error(tmp_path: Path, refusal: Refusal) -> None:
    """Class, message and position of the error match the fault in the file."""
    path = tmp_path / "run3.csv"
    path.write_bytes(refusal.content)

    with pytest.raises(errors.RunFileError, match=refusal.words) as caught:
        read_run(path)

    assert type(caught.value) is refusal.error
    assert caught.value.file == "run3.csv"
    assert refusal.row in (None, caught.value.row)
    assert refusal.column in (None, caught.value.column)
    assert str(caught.value).startswith("run3.csv")
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 1500


def test_table_of_broken_files_covers_every_error_that_a_file_can_cause() -> None:
    """Each leaf below RunFileError is caused by a file of the table or by a test below."""
    leaves = {leaf for leaf in errors.RunFileError.__subclasses__()}

    missing = leaves - {refusal.error for refusal in FILES}

    assert missing == {
        errors.UnreadableFile,
        errors.MappingError,
        # test_formats.py
        errors.UnsupportedContent,
        errors.MissingLibrary,
        errors.AmbiguousTable,
        # test_angle.py
        errors.AmbiguousAngle,
    }
    assert len({leaf.code for leaf in leaves}) == len(leaves)
    assert len(FILES) >= 60


@pytest.mark.parametrize("name", ["missing.csv", ".", "nul\0.csv", "x" * 5000])
def test_path_that_is_no_file_is_refused(tmp_path: Path, name: str) -> None:
    """Each path is missing or not a regular file."""
    with pytest.raises(errors.UnreadableFile, match="cannot be opened|is not a regular file"):
        read_run(f"{tmp_path}/{name}")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (Limits(bytes=1000), "bytes are more than the limit of 1000"),
        (Limits(rows=20), "more rows than the limit of 20"),
        (Limits(columns=4), "5 columns are more than the limit of 4"),
    ],
)
def test_file_over_a_limit_is_refused_with_the_limit(
    tmp_path: Path, limits: Limits, words: str
) -> None:
    """The canonical file has 41 lines, five columns and some 1,800 bytes."""
    path = tmp_path / "run.csv"
    path.write_bytes(write(record()))

    with pytest.raises(errors.FileTooLarge, match=words):
        read_run(path, limits=limits)
