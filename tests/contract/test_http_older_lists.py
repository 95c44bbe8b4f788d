"""Lists to select from: the pages say what they leave out, and older entries are reachable."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from html import unescape

import httpx
import pytest

from app.access.service import DEFAULT_WORKSPACE
from app.database import Database
from app.settings import load_settings
from tests.app.rows import fit_row, keep_runs
from tests.app.service import Caller, run_text, serving

FITS, RUNS = 100, 200
"""Length of the lists on the pages."""


@dataclass(frozen=True)
class Crowd:
    """Service with a fit of a motor, before more fits and runs than the lists hold.

    Args:
        http: Client of the pages.
        fit: ID of the fit, the oldest one.
        own: ID of its run, which has the motor.
        other: ID of a run as old without a motor.
    """

    http: httpx.Client
    fit: str
    own: str
    other: str


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Crowd]:
    """The newer rows need no files, because they are only listed."""
    data_dir = tmp_path_factory.mktemp("older") / "data"
    with (
        serving(data_dir, "--no-auth") as server,
        Caller(server) as caller,
        httpx.Client(base_url=server.url, timeout=60) as http,
    ):
        own = caller.upload(run_text(0), name="own.csv", motor="servo")["id"]
        other = caller.upload(run_text(1), name="other.csv")["id"]
        fit = caller.client.fit([own], motor="servo", options={"posterior": False}).id
        caller.wait(fit)
        database = Database(load_settings(data_dir=data_dir).sqlalchemy_url)
        keep_runs(database, DEFAULT_WORKSPACE, RUNS)
        now = time.time() + 60.0
        with database.writing() as session:
            newer = [fit_row(DEFAULT_WORKSPACE, "succeeded", ended_at=now) for _ in range(FITS)]
            failed = [fit_row(DEFAULT_WORKSPACE, "failed", ended_at=now) for _ in range(FITS)]
            for row in failed:
                row.motor = "servo"
            session.add_all([*newer, *failed])
        database.close()
        yield Crowd(http, fit, own, other)


def listed(page: str) -> list[str]:
    """IDs of the options of the first menu of a page."""
    return re.findall(r'<option value="((?:fit|run)_\w+)"', page.partition("</select>")[0])


def older(page: str, words: str) -> str:
    """Cursor of the button that shows older entries; empty if there is none."""
    found = re.search(rf'name="after" value="([^"]*)">Older {words}<', page)
    return unescape(found[1]) if found else ""


def test_comparison_reaches_older_fits_and_keeps_a_selected_one(crowd: Crowd) -> None:
    """The second page has the oldest fit, selected as in the address."""
    first = crowd.http.get("/compare").text
    query = {"fit": [crowd.fit, ""], "after": older(first, "fits")}
    second = crowd.http.get("/compare", params=query).text

    assert (len(listed(first)), crowd.fit in listed(first)) == (FITS, False)
    assert f"The list shows the newest {FITS} fits." in first
    assert listed(second) == [crowd.fit]
    assert f'<option value="{crowd.fit}" data-time=' in second
    assert re.search(rf'value="{crowd.fit}"[^>]* selected', second)
    assert "Select two different fits" not in second
    assert "Newest fits" in second
    assert older(second, "fits") == ""


def test_prediction_has_the_runs_of_the_motor_and_reaches_older_ones(crowd: Crowd) -> None:
    """The run of the motor is first, though many others are newer; the other one is further on."""
    path = f"/fits/{crowd.fit}/prediction"
    first = crowd.http.get(path).text
    query = {"run": crowd.own, "after": older(first, "runs")}
    second = crowd.http.get(path, params=query).text

    assert (len(listed(first)), listed(first)[0]) == (RUNS + 1, crowd.own)
    assert f"The list shows the newest {RUNS} runs and those of this motor." in first
    assert listed(second) == [crowd.own, crowd.other]
    assert re.search(rf'value="{crowd.own}" selected', second)
    assert "RMSE" not in second, "nothing is predicted while the list is turned"
    assert "Newest runs" in second


def test_page_of_a_motor_reaches_its_older_fits(crowd: Crowd) -> None:
    """The second page has the oldest fit alone, and leads back to the newest ones."""
    query = {"name": "servo"}
    first = crowd.http.get("/motor", params=query).text
    second = crowd.http.get("/motor", params=query | {"after": older(first, "fits")}).text

    assert (fits_of(first), crowd.fit in first) == (FITS, False)
    assert f"The list shows the newest {FITS} fits." in first
    assert (fits_of(second), crowd.fit in second) == (1, True)
    assert "The list shows 1 older fit." in second
    assert '<input type="hidden" name="name" value="servo">' in second
    assert "Newest fits" in second
    assert older(second, "fits") == ""


def fits_of(page: str) -> int:
    """Number of fits in the table of a motor."""
    return page.count('<th scope="row"><a href="/fits/fit_')


def test_short_lists_have_no_buttons(crowd: Crowd) -> None:
    """The last page says how many entries it has and offers no older ones."""
    first = crowd.http.get("/compare").text
    last = crowd.http.get("/compare", params={"after": older(first, "fits")}).text

    assert "The list shows 1 older fit and what is selected." in last
    assert "Older fits" not in last
