"""Settings of all tests: no test fails because the machine is busy."""

from __future__ import annotations

import gc

from hypothesis import HealthCheck, settings

settings.register_profile("any-load", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any-load")


def pytest_collection_finish() -> None:
    """Exempt imported modules and collected tests from garbage collection.

    The reader of a damaged file collects garbage, which takes 0.2 s for the objects of all tests.
    """
    gc.collect()
    gc.freeze()
