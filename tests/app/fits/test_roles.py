"""Which runs a fit takes."""

from __future__ import annotations

import pytest
from sqlalchemy import event

from app.access.service import Caller
from app.database import Database
from app.fits import repository, roles
from app.fits.request import FitRequest, new_row
from app.tables import FitRunRow
from tests.app.statements import statements


@pytest.mark.parametrize("number", [1, 600])
def test_runs_of_a_page_of_fits_are_read_in_few_queries_and_without_objects(
    database: Database, number: int
) -> None:
    """Two queries for 600 fits, and the runs in their order; objects cost six times the time."""
    training, validation = [f"run{n}" for n in (3, 1, 2)], ["run0"]
    request = FitRequest(training, validation, {"controllers": ["P:1"]})
    made = [(new_row(Caller("alice"), request), request) for _ in range(number)]
    with database.writing() as session:
        repository.add(session, *made)
    objects: list[object] = []

    def note(target: object, _context: object) -> None:
        objects.append(target)

    event.listen(FitRunRow, "load", note)
    try:
        with statements(database, written=False) as seen, database.reading() as session:
            found = roles.ids_of(session, [row.id for row, _ in made])
    finally:
        event.remove(FitRunRow, "load", note)

    assert found == {row.id: {"training": training, "validation": validation} for row, _ in made}
    assert sum(words.startswith("SELECT") for words in seen) <= 2
    assert objects == []
