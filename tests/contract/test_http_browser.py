"""Web pages in a real browser: their scripts run without errors or external requests.

Runs are fitted by the real pipeline, so that the report is real as well.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from identification.ingest import write_run
from motorid.client import Client
from tests.app.browser import Shown, needs_browser, show
from tests.app.service import Server, serving
from tests.motors import campaign, motor_named

pytestmark = needs_browser

SEVERAL = 3
HTML = {"Accept": "text/html"}
QUICKLY = {"posterior": False, "effects": False}


@dataclass(frozen=True)
class Bench:
    """Service with a fit and a batch.

    Args:
        server: The service.
        fit: ID of the fit.
        batch: ID of the batch.
    """

    server: Server
    fit: str
    batch: str


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """Service with two runs of the 100 W servo, one fit of both and a batch of several motors."""
    directory = tmp_path_factory.mktemp("browser")
    files = []
    for number, run in enumerate(campaign(motor_named("servo 100 W"), seed=3, runs=2, rows=400)):
        files.append(directory / f"run{number}.csv")
        write_run(run, files[-1])
    (directory / "help").mkdir()
    (directory / "help" / "index.html").write_text("<title>Help</title>")
    settings = {
        "PIPELINE": "identification.pipeline:identify",
        "HELP_DIR": str(directory / "help"),
    }
    with (
        serving(directory / "data", "--no-auth", **settings) as server,
        Client(server.url) as client,
    ):
        runs = [client.upload(file, motor="servo <1>") for file in files]
        # The runs contradict the known value, so that the result has a warning.
        options = QUICKLY | {"known": ["Kt25=1"]}
        fit = client.wait(client.fit(runs, motor="servo <1>", options=options))
        motors = [{"motor": f"servo <{n}>", "training": runs} for n in range(SEVERAL)]
        batch = client.wait_batch(client.batch(motors, options=QUICKLY, name="<b>refit"))
        assert batch.status == "succeeded"
        yield Bench(server, fit.id, batch.id)


def assert_is_quiet(shown: Shown, server: Server) -> None:
    """Check that the console is empty and all requests go to this service."""
    assert shown.console == []
    assert [a for a in shown.requests if not a.startswith(f"{server.url}/")] == []


def test_first_page_lists_runs_fits_and_batches(bench: Bench, tmp_path: Path) -> None:
    """The page shows two runs, four fits, one batch with its links, and all option fields."""
    shown = show(bench.server.url, tmp_path)

    assert_is_quiet(shown, bench.server)
    assert {a.partition("?")[0].removeprefix(bench.server.url) for a in shown.requests} >= {
        "/", "/static/motorid.css", "/static/home.js", "/static/calls.js",
        "/static/vendor/htmx/htmx.min.js",
    }  # fmt: skip
    assert len(re.findall(r'<tr data-run="', shown.dom)) == 2
    assert len(re.findall(r'<tr data-fit="', shown.dom)) == SEVERAL + 1
    assert len(re.findall(rf'<tr data-batch="{bench.batch}"', shown.dom)) == 1
    assert f'href="/api/v1/batches/{bench.batch}/report"' in shown.dom
    assert f'href="/api/v1/batches/{bench.batch}/results.csv"' in shown.dom
    assert "&lt;b&gt;refit" in shown.dom
    for field in ("known", "nameplate", "contradicting", "effort"):
        assert f'name="{field}"' in shown.dom


def test_page_of_a_fit_shows_its_parameters(bench: Bench, tmp_path: Path) -> None:
    """The table has the seven parameters of the nominal model; a link leads to the report."""
    shown = show(f"{bench.server.url}/fits/{bench.fit}", tmp_path)

    assert_is_quiet(shown, bench.server)
    for name in ("Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L"):
        assert f"<code>{name}</code>" in shown.dom
    assert f'href="/fits/{bench.fit}/report"' in shown.dom


def test_report_draws_in_its_sandbox(bench: Bench, tmp_path: Path) -> None:
    """The script draws under the policy of the header and sends no request."""
    shown = show(f"{bench.server.url}/api/v1/fits/{bench.fit}/report", tmp_path)

    assert_is_quiet(shown, bench.server)
    assert 'class="uplot' in shown.dom
    assert len(shown.requests) == 1


def codes_of(bench: Bench) -> set[str]:
    """Codes of the warnings of the fit."""
    with Client(bench.server.url) as client:
        result = client.show_fit(bench.fit).result
    assert result is not None
    return {detail["code"] for detail in result["warning_details"]}


def test_codes_of_warnings_lead_to_their_paragraphs(bench: Bench, tmp_path: Path) -> None:
    """Page and report link each code of result.json if the service has the documentation."""
    codes = codes_of(bench)
    links = {f'href="/help/troubleshooting.html#{code}"' for code in codes}
    framed = httpx.get(f"{bench.server.url}/fits/{bench.fit}/report").text
    report = f"/api/v1/fits/{bench.fit}/report?help"

    page = httpx.get(f"{bench.server.url}/fits/{bench.fit}").text
    linked = show(bench.server.url + report, tmp_path)
    saved = show(bench.server.url + report.removesuffix("?help"), tmp_path)

    assert codes
    assert '<a href="/help/">Help</a>' in page
    assert f'src="{report}"' in framed
    assert {link for link in links if link in page} == links
    assert {link for link in links if link in linked.dom} == links
    assert "/help/" not in saved.dom.replace(report_script(saved.dom), "")
    assert_is_quiet(linked, bench.server)


@pytest.mark.parametrize(
    "path",
    ["/", "/compare", "/docs", "/nowhere", "/motor?name=servo+<1>"]
    + [
        f"/fits/FIT{page}" for page in ("", "/loop", "/prediction", "/design", "/tuning", "/report")
    ],
)
def test_every_page_leads_to_the_documentation(bench: Bench, path: str) -> None:
    """The bar of each page has the same links."""
    answer = httpx.get(bench.server.url + path.replace("FIT", bench.fit), headers=HTML, timeout=60)

    assert '<a href="/help/">Help</a>' in answer.text
    assert '<a href="/">Runs and fits</a>' in answer.text


def report_script(dom: str) -> str:
    """Script of a report, which has the address of the documentation."""
    return dom[dom.rindex("<script") :]


def test_codes_of_a_file_that_is_checked_lead_to_their_paragraphs(bench: Bench) -> None:
    """A unit that is not in the table is the error `unknown_unit`."""
    lines = ["t [s],u [V],i [A],speed [furlong]", *(f"{k / 100},{k % 7},1,{k}" for k in range(50))]
    files = {"file": ("odd.csv", "\n".join(lines).encode())}

    part = httpx.post(f"{bench.server.url}/pending", files=files, headers={"HX-Request": "true"})

    assert 'href="/help/troubleshooting.html#unknown_unit"' in part.text


def test_fleet_page_shows_every_motor_without_a_script(bench: Bench, tmp_path: Path) -> None:
    """The policies of header and page permit its styles; the page is a single request."""
    shown = show(f"{bench.server.url}/api/v1/batches/{bench.batch}/report", tmp_path)

    assert_is_quiet(shown, bench.server)
    assert len(shown.requests) == 1
    told = shown.dom.partition('id="motors"')[2]
    for number in range(SEVERAL):
        assert f"servo &lt;{number}&gt;</a>" in told
    assert shown.dom.count("<svg") >= 5


def test_documentation_page_shows_the_calls(bench: Bench, tmp_path: Path) -> None:
    """The vendored viewer renders the OpenAPI document of this service."""
    shown = show(f"{bench.server.url}/docs", tmp_path)

    assert_is_quiet(shown, bench.server)
    assert "/api/v1/batches/{batch_id}/results" in shown.dom


def test_external_request_would_be_detected(bench: Bench, tmp_path: Path) -> None:
    """Negative control: an image on another host and a script error are both recorded."""
    page = tmp_path / "page.html"
    page.write_text('<!doctype html><script>nosuch()</script><img src="http://192.0.2.1/x.png">')

    shown = show(page.as_uri(), tmp_path)

    assert "http://192.0.2.1/x.png" in shown.requests
    assert any("nosuch is not defined" in line for line in shown.console)
