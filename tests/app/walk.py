"""Browser page of a user's walk, with the checks of every page on the way."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tests.app.service import Server

if TYPE_CHECKING:
    from playwright.sync_api import Page
AXE = (Path(__file__).parents[1] / "app" / "vendor" / "axe.min.js").read_text(encoding="utf-8")
WIDTHS = (1280, 390)
SMALL = """[...document.querySelectorAll("main *")].filter(element => {
  const hasText = [...element.childNodes].some(one => one.nodeType === 3 && one.data.trim());
  const matrix = element instanceof SVGGraphicsElement ? element.getScreenCTM() : null;
  const scale = matrix ? Math.hypot(matrix.a, matrix.b) : 1;
  const isShown = element.getBoundingClientRect().width > 0;
  return hasText && isShown && scale * parseFloat(getComputedStyle(element).fontSize) < 10.95;
}).map(element => element.textContent)"""
"""Texts below 11 pixels, drawings included."""
OVERLAPPING = """[...document.querySelectorAll("main button, main .button")].filter((one, k, all) =>
  all.slice(k + 1).some(other => {
    const a = one.getBoundingClientRect(), b = other.getBoundingClientRect();
    return Math.min(a.right, b.right) > Math.max(a.left, b.left) &&
      Math.min(a.bottom, b.bottom) > Math.max(a.top, b.top);
  })
).map(element => element.textContent)"""
"""Buttons that cover a part of another one."""


@dataclass
class Walk:
    """Browser page with everything that must not occur on it.

    Args:
        page: The page.
        server: The service.
        console: Messages on the console and uncaught errors.
        elsewhere: Requests to other hosts.
    """

    page: Page
    server: Server
    console: list[str] = field(default_factory=list)
    elsewhere: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.on(
            "console",
            lambda message: self.console.append(f"{message.text} {message.location.get('url')}"),
        )
        self.page.on("pageerror", lambda error: self.console.append(str(error)))
        self.page.on("request", lambda request: self._note(request.url))

    def _note(self, url: str) -> None:
        if not url.startswith((f"{self.server.url}/", "data:", "blob:")):
            self.elsewhere.append(url)

    def check(self) -> None:
        """Check the page when it is loaded, at both widths, in light and dark."""
        # Before its style sheets are there a page has another width.
        self.page.wait_for_load_state("load")
        for width in WIDTHS:
            self.page.set_viewport_size({"width": width, "height": 900})
            assert self.page.evaluate("document.documentElement.scrollWidth") == width
            assert self.page.evaluate(SMALL) == []
            assert self.page.evaluate(OVERLAPPING) == []
        self.page.evaluate(AXE)
        # A scheme changes colours only.
        self.page.emulate_media(color_scheme="dark")
        assert self.findings("runOnly: ['color-contrast']") == []
        self.page.emulate_media(color_scheme="light")
        assert self.findings() == []
        self.page.set_viewport_size({"width": WIDTHS[0], "height": 900})
        assert (self.console, self.elsewhere) == ([], [])

    def findings(self, rules: str = "") -> list[str]:
        """Serious and critical findings of axe-core, with the elements concerned."""
        found = self.page.evaluate(
            f"axe.run(document, {{iframes: false, resultTypes: ['violations'], {rules}}})"
        )
        return [
            f"{entry['id']}: {node['html'][:200]}"
            for entry in found["violations"]
            if entry["impact"] in ("serious", "critical")
            for node in entry["nodes"]
        ]

    def drop(self, files: list[Path]) -> None:
        """Drop files on the page."""
        held = self.page.evaluate_handle(
            """files => {
              const held = new DataTransfer();
              for (const [name, text] of files) {
                const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
                held.items.add(new File([bytes], name));
              }
              return held;
            }""",
            [[file.name, base64.b64encode(file.read_bytes()).decode()] for file in files],
        )
        self.page.dispatch_event("#drop", "drop", {"dataTransfer": held})
