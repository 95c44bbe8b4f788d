"""Build the container image without an engine, run it as an engine would, and test it.

    python -m benchmarks.container [--python PREFIX]

It needs Linux, root, and the programs buildah, unshare, nsenter and ip.  Without access to a
registry, `--python` replaces the base image; this needs Debian and debootstrap.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks.container.checks import run
from benchmarks.container.image import built

_PROGRAMS = ("buildah", "unshare", "nsenter", "ip")


def main(arguments: list[str] | None = None) -> int:
    """Build and test; the exit status is 1 after a failure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.container", description=__doc__)
    parser.add_argument("--python", type=Path, help="prefix of a Python, not the system's own")
    chosen = parser.parse_args(arguments)
    needed = _PROGRAMS if chosen.python is None else (*_PROGRAMS, "debootstrap")
    missing = [name for name in needed if shutil.which(name) is None]
    if os.geteuid() != 0 or missing:
        parser.error(f"expected root and these programs: {', '.join(missing or needed)}")
    has_passed = True
    with tempfile.TemporaryDirectory(prefix="motorid-container-") as directory:
        work = Path(directory)
        with built(work, chosen.python) as image:
            for outcome in run(image, work):
                verdict = "pass" if outcome.passed else "FAIL"
                print(f"{verdict}  {outcome.test}: {outcome.measured}", flush=True)
                has_passed &= outcome.passed
    return 0 if has_passed else 1


if __name__ == "__main__":
    sys.exit(main())
