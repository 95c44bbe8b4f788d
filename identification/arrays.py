"""Type of the numerical arrays; docstrings give the axes and the unit of each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array"]

Array = NDArray[np.float64]
