"""File permissions of the service commands: access for the owner only."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

COMMAND = "import sys; from app.cli import main; sys.exit(main(sys.argv[1:]))"


def test_database_in_an_open_directory_is_private(tmp_path: Path) -> None:
    """An existing directory keeps its mode; the database in it holds hashes of keys."""
    tmp_path.chmod(0o755)

    words = ["keys", "create", "bench", "--data-dir", str(tmp_path)]
    subprocess.run([sys.executable, "-c", COMMAND, *words], check=True, capture_output=True)

    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert files
    assert [path.name for path in files if path.stat().st_mode & 0o077] == []
