"""Types of the numerical arrays; docstrings give the axes and the unit of each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Bool", "Complex", "Index"]

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Index = NDArray[np.intp]
