"""Start page in a browser: each change of it keeps typed options and the place of the keyboard."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.app.browser import needs_browser, opened, wait_until_settled
from tests.app.pretended import SLOW
from tests.app.service import Caller, Server, empty, run_text

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

pytestmark = needs_browser

FILES = 5


@pytest.fixture
def server(open_server: Server) -> Server:
    """Service without keys."""
    return open_server


@pytest.fixture
def page(chromium: Browser, server: Server) -> Iterator[Page]:
    """Start page in a browser, without files, runs and fits of other tests."""
    empty(server)
    with opened(chromium, server.url) as shown:
        yield shown


def drop(page: Page, directory: Path, *seeds: int) -> None:
    """Select a file for each seed, and wait until all are shown and counted."""
    before = page.locator("article").count()
    paths = [directory / f"run{seed}.csv" for seed in seeds]
    for seed, path in zip(seeds, paths, strict=True):
        path.write_bytes(run_text(seed))
    page.set_input_files("#files", paths)
    page.locator(f"#pending-confirm[data-new='{before + len(seeds)}']").wait_for()


def focused(page: Page) -> str:
    """Text of the element that has the focus, or its ID if it has no text."""
    return str(
        page.evaluate("(({textContent, id}) => textContent.trim() || id)(document.activeElement)")
    )


def test_each_file_is_drawn_once_and_the_list_is_counted_once(page: Page, tmp_path: Path) -> None:
    """The samples of five files are requested five times and not fifteen times."""
    asked: list[str] = []
    page.on("request", lambda request: asked.append(f"{request.method} {request.url}"))

    drop(page, tmp_path, *range(FILES))
    page.locator("article .uplot").nth(4 * FILES - 1).wait_for()
    wait_until_settled(page)

    assert sum(url.endswith("/samples") for url in asked) == FILES
    assert sum(url.startswith("GET") and url.endswith("/pending") for url in asked) == 1
    assert page.locator("article .uplot").count() == 4 * FILES
    page.click("text=Discard all")
    page.locator("article").first.wait_for(state="detached")


def test_focus_follows_a_discarded_file(page: Page, tmp_path: Path) -> None:
    """The next file has it; after the last one the file before, after all the field for files."""
    drop(page, tmp_path, *range(10, 14))
    reached = []
    for position, left in ((0, 3), (2, 2)):
        page.locator("article").nth(position).get_by_text("Discard").focus()
        page.keyboard.press("Enter")
        page.locator("article").nth(left).wait_for(state="detached")
        reached.append(focused(page).split()[0])
    page.focus("#pending-discard")
    page.keyboard.press("Enter")
    page.locator("article").first.wait_for(state="detached")

    assert reached == ["run11.csv", "run12.csv"]
    assert focused(page) == "files"


def test_options_of_a_fit_outlive_added_runs_and_an_ended_fit(
    page: Page, server: Server, tmp_path: Path
) -> None:
    """The user types on while another fit ends and is removed, and while runs are added."""
    drop(page, tmp_path, 20)
    page.click("text=Add 1 run")
    page.locator("#runs tr").wait_for()
    assert focused(page) == "Runs"
    with Caller(server) as caller:
        stored = caller.client.upload(run_text(21), name="other.csv")
        fit = caller.begin(stored.id, seed=SLOW)
        page.reload()
        page.click("text=More options")
        page.focus("[name=known]")
        page.keyboard.type("Kt25=")
        caller.wait(fit["id"])
    page.locator("#work .state.succeeded").wait_for()
    page.locator("#work >> text=Report").wait_for()
    page.keyboard.type("0.05")
    drop(page, tmp_path, 22)
    page.click("text=Add 1 run")
    page.locator("#runs tr").nth(2).wait_for()
    page.click("#work >> text=Remove")
    page.locator("text=No fits yet").wait_for()

    assert page.input_value("[name=known]") == "Kt25=0.05"
    assert focused(page) == "Fits"


def test_what_another_tab_removed_leaves_the_lists(page: Page, tmp_path: Path) -> None:
    """The page says that it was removed, shows what is there, and keeps the typed options."""
    drop(page, tmp_path, 30, 31)
    page.click("text=Add 2 runs")
    page.locator("#runs tr", has_text="run31.csv").wait_for()
    page.click("text=More options")
    page.fill("[name=known]", "Kt25=0.05")
    drop(page, tmp_path, 32, 33)
    other = page.context.new_page()
    other.on("dialog", lambda dialog: dialog.accept())
    other.goto(page.url)
    other.get_by_label("Delete run31.csv").click()
    other.locator("#runs tr", has_text="run31.csv").wait_for(state="detached")
    other.get_by_label("Discard run33.csv").click()
    other.locator("article").nth(1).wait_for(state="detached")
    other.close()

    page.get_by_label("Role of run31.csv").select_option("validation")
    page.locator("#problem", has_text="removed in the meantime").wait_for()

    assert page.locator("#runs tr", has_text="run31.csv").count() == 0
    assert page.locator("#runs tr", has_text="run30.csv").count() == 1
    assert page.locator("article").count() == 1
    assert page.input_value("[name=known]") == "Kt25=0.05"


def test_run_that_gets_another_motor_leaves_the_table_with_a_word(
    page: Page, tmp_path: Path
) -> None:
    """The keyboard goes on with the next run; after the last one the table shows all motors."""
    page.fill("#motor", "motor 17")
    drop(page, tmp_path, 40, 41)
    page.click("text=Add 2 runs")
    page.locator("#runs tr").nth(1).wait_for()
    rename(page, "run41.csv")
    said = page.locator("#choice .notice").inner_text()
    reached = page.evaluate("document.activeElement.ariaLabel")
    rename(page, "run40.csv")
    page.locator("#runs tr").nth(1).wait_for()

    assert re.sub("[\u2068\u2069]", "", said) == (
        "run41.csv now belongs to “motor 170”. This table shows the runs of “motor 17”."
    )
    assert reached == "Role of run40.csv"
    assert page.input_value("#choice-motor") == "*"
    assert page.evaluate("document.activeElement.id").startswith("mapping-")


def rename(page: Page, file: str) -> None:
    """Type a digit behind the motor of a run, go on by Tab, and wait for the table."""
    page.get_by_label(f"Motor of {file}").focus()
    page.keyboard.press("End")
    page.keyboard.type("0")
    with page.expect_response(re.compile("/motor[?]")) as answer:
        page.keyboard.press("Tab")
    answer.value.finished()
    wait_until_settled(page)
