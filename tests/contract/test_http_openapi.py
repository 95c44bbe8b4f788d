"""The OpenAPI document: complete, with valid examples, and consistent with responses."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from app.main import create_app
from app.settings import load_settings
from tests.app.service import Caller

CONTRACT = {
    ("POST", "/api/v1/runs"),
    ("GET", "/api/v1/runs"),
    ("GET", "/api/v1/runs/{run_id}"),
    ("DELETE", "/api/v1/runs/{run_id}"),
    ("POST", "/api/v1/fits"),
    ("GET", "/api/v1/fits"),
    ("GET", "/api/v1/fits/{fit_id}"),
    ("GET", "/api/v1/fits/{fit_id}/events"),
    ("DELETE", "/api/v1/fits/{fit_id}"),
    ("GET", "/api/v1/fits/{fit_id}/report"),
    ("GET", "/api/v1/fits/{fit_id}/posterior"),
    ("POST", "/api/v1/batches"),
    ("GET", "/api/v1/batches/{batch_id}"),
    ("GET", "/api/v1/healthz"),
    ("GET", "/api/v1/readyz"),
    ("GET", "/api/v1/metrics"),
}


@pytest.fixture(scope="module")
def schema(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The document as the service sends it."""
    settings = load_settings(data_dir=tmp_path_factory.mktemp("openapi"))
    return create_app(settings).openapi()


def described(schema: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    """Each call of the document by method and path."""
    return {
        (method.upper(), path): call
        for path, calls in schema["paths"].items()
        for method, call in calls.items()
    }


def test_every_call_of_the_contract_is_described(schema: dict[str, Any]) -> None:
    """The document contains each call of the contract."""
    assert described(schema).keys() >= CONTRACT


def test_every_call_documents_its_purpose_and_errors(schema: dict[str, Any]) -> None:
    """Each call has a summary, a description, its error responses and, except health, a key."""
    for call, entry in described(schema).items():
        assert entry["summary"], call
        assert entry["description"], call
        is_health = entry["tags"] == ["health"]
        assert entry["security"] == ([] if is_health else [{"key": []}]), call
        assert is_health or "401" in entry["responses"], call
        for status, answer in entry["responses"].items():
            if status.startswith(("4", "5")) and not is_health:
                assert "application/problem+json" in answer["content"], (call, status)
        if "{" in call[1]:
            assert "404" in entry["responses"], call


def test_examples_conform_to_their_schemas(schema: dict[str, Any]) -> None:
    """Each example in the document is valid under its own schema."""
    components = schema["components"]["schemas"]
    checked = 0
    for name, part in components.items():
        for example in part.get("examples", []):
            whole = {"$ref": f"#/components/schemas/{name}", "components": {"schemas": components}}
            Draft202012Validator(whole).validate(example)
            checked += 1

    assert checked >= 7
    assert {"RunOut", "FitOut", "FitCreate", "BatchCreate", "BatchOut", "Problem"} <= {
        name for name, part in components.items() if part.get("examples")
    }


def test_responses_conform_to_the_document(
    schema: dict[str, Any], alice: Caller, stored: str
) -> None:
    """Real responses are valid under the schema of their call and status."""
    fit = alice.wait(alice.begin(stored)["id"])["id"]
    batch = alice.http.post("/batches", json={"motors": [{"training": [stored]}]}).json()["id"]
    calls = {
        f"/runs/{stored}": "/api/v1/runs/{run_id}",
        f"/fits/{fit}": "/api/v1/fits/{fit_id}",
        f"/batches/{batch}": "/api/v1/batches/{batch_id}",
        "/runs": "/api/v1/runs",
        "/fits": "/api/v1/fits",
        "/readyz": "/api/v1/readyz",
        "/runs/x": "/api/v1/runs/{run_id}",
        "/fits?limit=0": "/api/v1/fits",
    }
    for address, path in calls.items():
        answer = alice.http.get(address)
        entry = schema["paths"][path]["get"]["responses"][str(answer.status_code)]
        kind = answer.headers["content-type"].partition(";")[0]
        part = entry["content"][kind]["schema"]
        Draft202012Validator(part | {"components": schema["components"]}).validate(answer.json())


def test_document_is_served_to_clients(alice: Caller, schema: dict[str, Any]) -> None:
    """The path under the API prefix serves the same document."""
    assert alice.http.get("/openapi.json").json() == schema


def test_metrics_count_requests_and_fits(alice: Caller, stored: str) -> None:
    """Requests and succeeded fits increase their counters; no ID is a label."""

    def value(name: str) -> float:
        text = alice.http.get("/metrics").text
        found = re.search(rf"^{re.escape(name)} (\S+)$", text, re.MULTILINE)
        return float(found.group(1)) if found else 0.0

    route = 'motorid_http_requests_total{method="GET",route="/api/v1/fits/{fit_id}",status="200"}'
    before = value('motorid_fits_ended_total{status="succeeded"}')
    asked = value(route)
    fit = alice.wait(alice.begin(stored)["id"])["id"]

    assert value('motorid_fits_ended_total{status="succeeded"}') >= before + 1
    assert value('motorid_fits{status="succeeded"}') >= 1
    assert value(route) > asked
    text = alice.http.get("/metrics").text
    assert fit not in text
    assert stored not in text


def test_page_about_http_names_every_call(schema: dict[str, Any]) -> None:
    """docs/http.md names each call of the OpenAPI document."""
    page = (Path(__file__).parents[2] / "docs" / "http.md").read_text(encoding="utf-8")

    for method, path in described(schema):
        short = path.removeprefix("/api/v1")
        short = re.sub(r"\{\w+_id\}", "{id}", short)
        assert f"`{method} {short}`" in page, (method, short)
