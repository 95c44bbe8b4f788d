"""Multi-value fields of the page, split as on the command line."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from identification.known import known_values

NODE = shutil.which("node")
WORDS = Path(__file__).parents[3] / "app" / "pages" / "static" / "words.js"

pytestmark = pytest.mark.skipif(NODE is None, reason="no node on this machine")


def known_words(text: str) -> list[str]:
    """Values that the page sends for a text in the field of known values."""
    script = (
        f"import {{ knownWords }} from {json.dumps(WORDS.as_uri())};"
        f"console.log(JSON.stringify(knownWords({json.dumps(text)})))"
    )
    finished = subprocess.run(
        [str(NODE), "--input-type=module", "--eval", script],
        check=True,
        capture_output=True,
        text=True,
    )
    words: list[str] = json.loads(finished.stdout)
    return words


@pytest.mark.parametrize(
    "text",
    [
        "Kt25=0.048+-5% L=2.9e-3",
        "Kt25 = 0.048 +- 5 %, L = 2.9e-3",
        "  Kt25=0.048 ± 5 % ;L=2.9e-3\n",
        "Kt25=0.048+-5%; L=2.9e-3",
    ],
)
def test_known_values_may_have_blanks_around_their_signs(text: str) -> None:
    """Blanks around = and +- do not split a value."""
    assert known_values(known_words(text)) == known_values(["Kt25=0.048+-5%", "L=2.9e-3"])


def test_an_empty_field_is_no_value() -> None:
    """A field with blanks only gives no value."""
    assert known_words("  ") == []
