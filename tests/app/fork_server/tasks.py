"""Tasks for the tests of the fork server; the content of a task selects its behaviour."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from typing import Any


def handle(task: dict[str, Any], answer: int) -> None:
    """Behave as the task requests."""
    if "echo" in task:
        os.write(answer, json.dumps({"echo": task["echo"]}).encode() + b"\n")
    if "signal" in task:
        os.kill(os.getpid(), task["signal"])
    if "exit" in task:
        sys.exit(task["exit"])
    if "family" in task:
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        os.write(answer, json.dumps({"pids": [os.getpid(), child.pid]}).encode() + b"\n")
        if task["family"] == "stays":
            time.sleep(60)
    if "half" in task:
        os.write(answer, b'{"half": ')
        os.kill(os.getpid(), signal.SIGKILL)
    if "junk" in task:
        os.write(answer, task["junk"].encode() + b"\n")
    if "fills" in task:
        # Fill the pipe, so that the exit message has no space.
        os.write(answer, b"x" * 65_536)
