"""Signatures of the native part."""

from collections.abc import Callable
from typing import final

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

@final
class LinearLoop:
    def __new__(
        cls,
        a: NDArray[np.float64],
        b: NDArray[np.float64],
        e: NDArray[np.float64],
        k: NDArray[np.float64],
        l: float,
        m: float,
        c: NDArray[np.float64],
        d: float,
        delay: float,
        sample_time: float | None = None,
        limit: float | None = None,
    ) -> LinearLoop: ...
    def simulate(
        self,
        output_times: NDArray[np.float64],
        input_times: NDArray[np.float64],
        state: NDArray[np.float64],
        command: float,
        reference_before: float,
        reference_times: NDArray[np.float64],
        reference_values: NDArray[np.float64],
        command_history: NDArray[np.float64],
        sample_phase: float,
    ) -> tuple[
        NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
    ]: ...
    def transition_matrix(self) -> NDArray[np.float64]: ...
    def poles(self) -> NDArray[np.complex128]: ...

def sampled_abscissa_grid(
    cells: int,
    states: int,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    k: NDArray[np.float64],
    l: NDArray[np.float64],
    scale: NDArray[np.float64],
    delay: NDArray[np.float64],
    sample_time: NDArray[np.float64],
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]: ...
