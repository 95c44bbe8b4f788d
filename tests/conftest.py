"""Settings of all tests: no test fails because the machine is busy."""

from __future__ import annotations

import gc
import os

import pytest
import scipy.linalg  # noqa: F401  a library must be loaded before its threads can be limited
from hypothesis import HealthCheck, settings

from identification.threads import repeatable_algebra

settings.register_profile("any-load", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any-load")

# The processes of a run share the cores: threads of linear algebra would only wait for each other.
# A fit has this limit in any case; the tests of its parts have it here.
repeatable_algebra()

# The tests call their services by plain HTTP, but httpx reads the authorities of the machine for
# each client (32 ms).  A directory is searched only when a certificate is checked.
os.environ.pop("SSL_CERT_FILE", None)
os.environ["SSL_CERT_DIR"] = os.path.dirname(__file__)

LONG = (
    "app/test_torture.py",
    "contract/cli/test_signals.py",
    "contract/test_http_signed_in.py",
    "contract/test_http_slow_answers.py",
    "contract/test_http_walk.py",
    "contract/test_torture.py",
    "effects/test_bad_cases.py",
    "effects/test_lag.py",
    "fit/test_knowledge.py",
    "selection/test_noise_model.py",
    "selection/test_search.py",
    "surrogates/test_unlisted.py",
    "tests/test_peers.py",
)
"""Files that take more than half a minute."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the long files, so that no process works on one of them alone at the end."""
    items.sort(key=lambda item: not item.path.as_posix().endswith(LONG))


def pytest_collection_finish() -> None:
    """Exempt imported modules and collected tests from garbage collection.

    The reader of a damaged file collects garbage, which takes 0.2 s for the objects of all tests.
    """
    gc.collect()
    gc.freeze()
