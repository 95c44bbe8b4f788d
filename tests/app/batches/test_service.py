"""Combined state of the fits of a batch."""

from __future__ import annotations

import pytest

from app.batches.service import StoredBatch
from app.tables import BatchRow


@pytest.mark.parametrize(
    ("counts", "status"),
    [
        ({"queued": 3}, "queued"),
        ({"queued": 2, "running": 1}, "running"),
        ({"queued": 1, "succeeded": 2}, "running"),
        ({"running": 1, "failed": 2}, "running"),
        ({"succeeded": 3}, "succeeded"),
        ({"failed": 3}, "failed"),
        ({"cancelled": 3}, "cancelled"),
        ({"succeeded": 2, "failed": 1}, "partial"),
        ({"succeeded": 2, "cancelled": 1}, "partial"),
        ({"failed": 2, "cancelled": 1}, "failed"),
        ({"succeeded": 3, "failed": 0}, "succeeded"),
    ],
)
def test_status_of_a_batch_follows_from_its_fits(counts: dict[str, int], status: str) -> None:
    """The rules are those of docs/http.md, section "Batches"."""
    assert StoredBatch(BatchRow(id="batch"), counts).status == status
