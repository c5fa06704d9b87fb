from collections.abc import Callable
from typing import final

import numpy as np
from numpy.typing import NDArray

def spin(
    seconds: float, threads: int | None = None, progress: Callable[[int], object] | None = None
) -> int: ...
def thread_count(threads: int | None = None) -> int: ...

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
