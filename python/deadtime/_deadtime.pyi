"""Signatures of the native part."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["dde_roots", "lambertw", "spin", "thread_count"]

def thread_count(threads: int | None = None) -> int: ...
def spin(
    seconds: float, threads: int | None = None, progress: Callable[[int], object] | None = None
) -> int: ...
def lambertw(
    z: NDArray[np.complex128], k: NDArray[np.int64], threads: int | None = None
) -> NDArray[np.complex128]: ...
def dde_roots(
    a0: NDArray[np.float64],
    a1: NDArray[np.float64],
    delay: NDArray[np.float64],
    k: NDArray[np.int64],
    threads: int | None = None,
) -> NDArray[np.complex128]: ...
