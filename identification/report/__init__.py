"""HTML report: text, tables and figures of a result; it computes no statistics.

The package can be called: it shares its name with the function `identification.report`, whose
attribute it takes as soon as one of its modules is imported.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from identification.report.files import HasFindings


def _report(identification: HasFindings, path: str | os.PathLike[str] = "report.html") -> Path:
    """Write the report of an identification; see `identification.report.files.report`."""
    from identification.report.files import report

    return report(identification, path)


class _Callable(ModuleType):
    __call__ = staticmethod(_report)


sys.modules[__name__].__class__ = _Callable
