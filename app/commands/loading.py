"""Import of many modules without searches for garbage.

The modules of a fit make 140,000 objects, none of which becomes garbage.  The searches that visit
them during the imports and the fit take a twentieth of the time of a fit of a short record.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["loading"]


@contextmanager
def loading() -> Iterator[None]:
    """Import modules in the block; their objects are excluded from later searches for garbage."""
    count = len(sys.modules)
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
    # Nothing was imported if this process has run a command before; its garbage remains garbage.
    if len(sys.modules) > count:
        gc.freeze()
