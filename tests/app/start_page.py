"""Start page in a browser: files, roles, presses and the fit that it starts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.app.service import Caller, run_text

if TYPE_CHECKING:
    from playwright.sync_api import Page


def drop(page: Page, directory: Path, *seeds: int) -> None:
    """Select a file for each seed, and wait until all are shown."""
    paths = [directory / f"new{seed}.csv" for seed in seeds]
    for seed, path in zip(seeds, paths, strict=True):
        path.write_bytes(run_text(seed))
    page.set_input_files("#files", paths)


def roles(page: Page) -> dict[str, str]:
    """Role of each run as the page shows it, by file."""
    menus = page.locator("#runs select").all()
    names = [str(menu.get_attribute("aria-label")).removeprefix("Role of ") for menu in menus]
    return dict(zip(names, (menu.input_value() for menu in menus), strict=True))


def roles_before_and_after_a_reload(page: Page) -> tuple[dict[str, str], dict[str, str]]:
    """Roles as the page shows them and as the service has them."""
    before = roles(page)
    page.reload()
    return before, roles(page)


def press(page: Page, click: int = 1) -> None:
    """Press the mouse where it is, with this number of clicks in a row."""
    page.mouse.down(click_count=click)
    page.mouse.up(click_count=click)


def only_fit(page: Page, caller: Caller) -> dict[str, Any]:
    """The fit that the page has started, with files in place of runs."""
    page.wait_for_url("**/fits/fit_*")
    [fit] = caller.client.fits()
    files = {run.id: run.content["file"] for run in caller.client.runs()}
    content = dict(fit.content)
    return content | {
        role: {files[run] for run in content[role]} for role in ("training", "validation")
    }
