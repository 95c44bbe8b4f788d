"""Atomic file writing: files appear complete or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification.result.atomic import replacing, write_text


def test_a_failure_half_way_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    """A failed write keeps the old content and leaves no temporary file."""
    target = tmp_path / "result.json"
    target.write_text("old", encoding="utf-8")

    with pytest.raises(UnicodeEncodeError, match="surrogates not allowed"):
        write_text(target, "ne\ud800w")

    assert target.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_file_is_replaced_in_one_step(tmp_path: Path) -> None:
    """Readers see the old content until the block ends."""
    target = tmp_path / "report.html"
    write_text(target, "old")

    with replacing(target) as neighbour:
        neighbour.write_text("new", encoding="utf-8")
        seen = target.read_text(encoding="utf-8")

    assert seen == "old"
    assert target.read_text(encoding="utf-8") == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_written_file_has_the_default_permissions(tmp_path: Path) -> None:
    """The mode is that of an ordinary new file, not the private mode of a temporary file."""
    plain = tmp_path / "plain"
    plain.touch()

    write_text(tmp_path / "made", "Ω\n")

    assert (tmp_path / "made").stat().st_mode == plain.stat().st_mode
    assert (tmp_path / "made").read_bytes() == "Ω\n".encode()
