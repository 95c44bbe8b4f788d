"""What the commands of the service write is for nobody but its owner."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

COMMAND = "import sys; from app.cli import main; sys.exit(main(sys.argv[1:]))"


def test_a_data_directory_that_is_open_to_all_gets_no_open_database(tmp_path: Path) -> None:
    """It was there before, so it stays as it is; digests of keys are in the database."""
    tmp_path.chmod(0o755)

    words = ["keys", "create", "bench", "--data-dir", str(tmp_path)]
    subprocess.run([sys.executable, "-c", COMMAND, *words], check=True, capture_output=True)

    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert files
    assert [path.name for path in files if path.stat().st_mode & 0o077] == []
