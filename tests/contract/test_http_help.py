"""The documentation site below /help/, without a key and with its own policy."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.settings import load_settings
from identification.errors import OptionError
from tests.app.service import Server, serving

SCRIPT = "document.title += '!'"


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Server that requires keys, with a site of two pages and a file beside it."""
    root = tmp_path_factory.mktemp("help")
    site = root / "site"
    (site / "adr").mkdir(parents=True)
    (site / "index.html").write_text(f"<title>Help</title><script>{SCRIPT}</script>")
    (site / "adr" / "one.html").write_text('<script src="../a.js"></script>')
    (root / "secret.html").write_text("secret")
    with serving(root / "data", HELP_DIR=site) as server:
        yield server


@pytest.mark.parametrize("path", ["/help/", "/help/index.html", "/help/adr/one.html"])
def test_pages_need_no_key_and_run_only_their_own_scripts(served: Server, path: str) -> None:
    """The hash in the policy is that of the inline script; nothing else inline is admitted."""
    answer = httpx.get(f"{served.url}{path}")

    policy = answer.headers["content-security-policy"]
    digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    assert answer.status_code == 200
    assert policy.startswith("default-src 'none'")
    assert f"script-src 'self' 'sha256-{digest}'; style-src 'self';" in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["cache-control"] == "no-cache"


@pytest.mark.parametrize(
    "path",
    ["/help/../secret.html", "/help/%2e%2e/secret.html", "/help/..%2fsecret.html", "/help/a"],
)
def test_only_files_of_the_site_are_served(served: Server, path: str) -> None:
    """A path that leaves the directory is not found, or is that of a page that needs a key."""
    answer = httpx.get(f"{served.url}{path}")

    assert answer.status_code in (303, 401, 404)
    assert "secret" not in answer.text


def test_site_is_read_only_and_the_rest_needs_a_key(served: Server) -> None:
    """Only GET and HEAD reach a file; the start page leads to the login."""
    assert httpx.delete(f"{served.url}/help/index.html").status_code == 405
    assert httpx.get(f"{served.url}/", headers={"accept": "text/html"}).status_code == 303


def test_without_the_setting_there_is_no_help(server: Server) -> None:
    """The service does not look for a site by itself."""
    assert httpx.get(f"{server.url}/help/").status_code == 404


def test_directory_without_a_site_is_refused_at_the_start(tmp_path: Path) -> None:
    """The message names the command that builds it."""
    with pytest.raises(OptionError, match="make docs-site"):
        load_settings(data_dir=tmp_path, help_dir=tmp_path)
