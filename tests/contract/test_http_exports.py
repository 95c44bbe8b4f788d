"""Exports over HTTP: the files of `motorid export`."""

from __future__ import annotations

import json
from pathlib import Path

import httpx
import pytest

from app.errors import FieldRefused
from app.fits.exports import EXPORTS, exported
from identification.export import FORMATS
from motorid.client import Client
from motorid.errors import Problem
from tests.app.service import Caller, Server
from tests.contract.hostile import assert_is_problem
from tests.export.results import CASES, result_with


@pytest.fixture(scope="module")
def fit(alice: Caller, stored: str) -> str:
    """ID of a succeeded fit."""
    return str(alice.wait(alice.begin(stored)["id"])["id"])


def test_the_service_offers_the_formats_of_the_library() -> None:
    """The service lists them without loading the simulation."""
    assert list(EXPORTS) == list(FORMATS)


def test_page_of_a_fit_leads_to_every_format(alice: Caller, server: Server, fit: str) -> None:
    """A control engineer finds the FMU without the documentation of the interface."""
    headers = {**alice.http.headers, "Accept": "text/html"}

    page = httpx.get(f"{server.url}/fits/{fit}", headers=headers, timeout=30).text

    linked = [form for form in FORMATS if f'href="/api/v1/fits/{fit}/exports/{form}"' in page]
    assert linked == list(FORMATS)


def test_table_of_a_fit_is_an_attachment(alice: Caller, fit: str) -> None:
    """The file is named by the fit, and each row is a parameter or a metric."""
    answer = alice.http.get(f"/fits/{fit}/exports/csv")

    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/csv")
    assert answer.headers["content-disposition"] == f'attachment; filename="{fit}.csv"'
    assert answer.text.startswith("group,name,temperature_degC,")


def test_client_writes_the_export(alice: Caller, server: Server, fit: str, tmp_path: Path) -> None:
    """The file is that of the call; an unknown format leaves none."""
    key = alice.http.headers["authorization"].removeprefix("Bearer ")
    with Client(server.url, key) as client:
        path = client.fetch_export(fit, "csv", tmp_path / "motor.csv")
        with pytest.raises(Problem, match="temperatures"):
            client.fetch_export(fit, "csv", tmp_path / "none", temperatures=[25.0, -10.0])
        with pytest.raises(Problem, match="expected python-control"):
            client.fetch_export(fit, "excel", tmp_path / "none")

    assert path.read_text("utf-8") == alice.http.get(f"/fits/{fit}/exports/csv").text
    assert [file.name for file in tmp_path.iterdir()] == ["motor.csv"]


@pytest.mark.parametrize("form", ["excel", "csv%20", "CSV"])
def test_unknown_format_is_refused_with_the_known_ones(alice: Caller, fit: str, form: str) -> None:
    """The answer is 422; names are exact."""
    answer = alice.http.get(f"/fits/{fit}/exports/{form}")

    assert_is_problem(answer, 422)
    assert "expected python-control" in answer.json()["detail"]


def test_fit_of_another_workspace_is_not_found(alice: Caller, bob: Caller, fit: str) -> None:
    """An id of another workspace is like one that does not exist."""
    assert_is_problem(bob.http.get(f"/fits/{fit}/exports/csv"), 404)
    assert_is_problem(alice.http.get("/fits/fit_nothing/exports/csv"), 404)


def test_export_is_that_of_the_command(tmp_path: Path) -> None:
    """The file has the effects; a temperature that is refused gives the command's reason."""
    result = result_with(*CASES["cogging and a first-order hold"])
    (tmp_path / "result.json").write_text(json.dumps(result), encoding="utf-8")

    assert b"cogging_torque.order" in exported(tmp_path, "modelica", []).replace(
        b"_order", b".order"
    )
    with pytest.raises(FieldRefused, match="temperature is 900 degC; expected -273.15 to 400"):
        exported(tmp_path, "modelica", [900.0])
