"""The documentation as a site: complete, self-contained and searchable."""

from __future__ import annotations

import html.parser
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import identification
from tests.app.browser import needs_browser, show
from tests.app.service import serving

pytest.importorskip("mkdocstrings", reason="mkdocs-material and mkdocstrings are not installed")

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GENERATED = {"python-reference.md", "http-reference.md", "result-reference.md"}
LOADING = {"script", "img", "iframe", "source", "embed", "object", "video", "audio", "track"}
"""Elements whose address a browser loads without a click; links of a page are not among them."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Site built strictly: a broken link, anchor or reference is an error.

    The build has the files that the Dockerfile copies for it, and no others.
    """
    out = tmp_path_factory.mktemp("site")
    tree = tmp_path_factory.mktemp("sources")
    stages = (ROOT / "Dockerfile").read_text("utf-8").partition("mkdocs build")[0]
    for words in re.findall(r"^COPY (?!--from)(.+)$", stages, flags=re.MULTILINE):
        *sources, target = words.split()
        for source in sources:
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, tree / target)
            else:
                (tree / target).mkdir(exist_ok=True)
                shutil.copy(ROOT / source, tree / target)
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(out)],
        cwd=tree,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )
    assert built.returncode == 0, built.stderr
    return out


def leaves(nav: Any) -> Iterator[str]:
    """Pages of the navigation, from top to bottom."""
    if isinstance(nav, str):
        yield nav
    else:
        for entry in nav.values() if isinstance(nav, dict) else nav:
            yield from leaves(entry)


class Loaded(html.parser.HTMLParser):
    """Addresses that a browser loads with a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect ``src``, ``data``, ``srcset``, and ``href`` of links in the head."""
        given = {name: value or "" for name, value in attrs}
        if tag in LOADING:
            self.found += [given[n] for n in ("src", "data", "srcset", "poster") if n in given]
        if tag == "link" and given.get("rel") not in ("prev", "next"):
            self.found.append(given.get("href", ""))


def test_navigation_lists_every_page_once() -> None:
    """The files of docs/ and the generated pages, neither more nor twice."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = list(leaves(yaml.safe_load(text)["nav"]))
    pages = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}

    assert sorted(listed) == sorted(pages | GENERATED)


def test_no_page_loads_anything_from_another_host(site: Path) -> None:
    """Addresses of scripts, styles, images and fonts are relative and lead to a file."""
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 50
    for page in pages:
        loaded = Loaded()
        loaded.feed(page.read_text(encoding="utf-8"))
        assert loaded.found
        for address in loaded.found:
            assert not re.match(r"(\w+:)?//|\w+:(?!image)", address), f"{page.name}: {address}"
            if page.name != "404.html" and not address.startswith("data:"):
                assert (page.parent / address.partition("?")[0]).is_file(), address
    for style in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*['\"]?(https?:)?//", style.read_text("utf-8"))


def test_reference_has_every_public_name(site: Path) -> None:
    """An anchor for each name in `identification.__all__`, with its first sentence."""
    page = (site / "python-reference.html").read_text(encoding="utf-8")

    anchors = set(re.findall(r'id="identification\.[\w.]*?(\w+)"', page))

    assert set(identification.__all__) <= anchors
    assert "Identify one motor from its runs." in page


def test_search_finds_pages_and_generated_references(site: Path) -> None:
    """The index holds an effect, a call of the service and a function."""
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))
    locations = {entry["location"] for entry in index["docs"]}
    assert {"effects.html#brush_drop", "http-reference.html#post-apiv1runs"} <= locations
    assert any("identification.identified.inference_data" in place for place in locations)


@needs_browser
def test_service_shows_the_site_within_its_policy(site: Path, tmp_path: Path) -> None:
    """Chromium logs each violation of the policy; the search field exists, so the scripts ran.

    Only a page of the service has the way back to its start page.
    """
    with serving(tmp_path / "data", HELP_DIR=site) as server:
        shown = show(f"{server.url}/help/effects.html?q=brush", tmp_path)
    alone = show((site / "effects.html").as_uri(), tmp_path)

    assert ['href="/"' in page.dom for page in (shown, alone)] == [True, False]
    assert shown.console == []
    assert all(address.startswith(f"{server.url}/help/") for address in shown.requests)
    assert any("search_index.json" in address for address in shown.requests)
    assert re.search(r'<html[^>]* class="js', shown.dom)
