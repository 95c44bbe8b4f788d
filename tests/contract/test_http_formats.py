"""Uploads of binary formats: parsed in the process with limits, and fitted like text."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.service import Caller
from tests.ingest.broken_formats import BROKEN
from tests.ingest.specimens import SPECIMENS
from tests.ingest.writers import BrokenSpecimen, Specimen


@pytest.mark.parametrize(
    "specimen",
    {Path(s.name).suffix: s for s in SPECIMENS if s.mapping is None}.values(),
    ids=lambda s: f"{s.name} {s.title}",
)
def test_upload_of_every_format_is_a_run(alice: Caller, tmp_path: Path, specimen: Specimen) -> None:
    """The record has 40 samples at 1 kHz; the libraries work below the limits of the process."""
    path = specimen.made(tmp_path)

    answer = alice.http.post("/runs", files={"file": (path.name, path.read_bytes())})

    assert answer.status_code in (200, 201), answer.text
    assert answer.json()["rows"] == 40
    assert answer.json()["sample_rate_hz"] == pytest.approx(1000.0)


@pytest.mark.parametrize(
    "broken",
    [b for b in BROKEN if b.file.mapping is None][::4],
    ids=lambda b: f"{b.file.name} {b.file.title}",
)
def test_upload_of_a_broken_file_is_refused_with_its_code(
    alice: Caller, tmp_path: Path, broken: BrokenSpecimen
) -> None:
    """The same error as on the command line."""
    path = broken.file.made(tmp_path)

    answer = alice.http.post("/runs", files={"file": (path.name, path.read_bytes())})

    assert answer.status_code == 422
    assert answer.json()["detail"].startswith(path.name)
    assert all(words in answer.json()["detail"] for words in broken.words)
