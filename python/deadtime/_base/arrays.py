"""The types of arrays, under one name each."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Real numbers.
Array: TypeAlias = NDArray[np.float64]

#: Complex numbers.
Complex: TypeAlias = NDArray[np.complex128]

#: Whether each of something holds.
Mask: TypeAlias = NDArray[np.bool_]

#: Indices of rows or entries.
Indices: TypeAlias = NDArray[np.intp]
