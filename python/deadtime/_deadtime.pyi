"""Signatures of the native part."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Certificate",
    "CharacteristicMatrix",
    "Contour",
    "Crossings",
    "DelayPieces",
    "DelayRun",
    "Expansion",
    "Family",
    "LinearLoop",
    "LinearSystem",
    "MapBoundary",
    "MapCells",
    "Margins",
    "Monotone",
    "ProvedBoxes",
    "QuasiPolynomial",
    "RootSet",
    "Segment",
    "Sensitivity",
    "Signal",
    "StabilityRadius",
    "at_read",
    "at_write",
    "configuration_read",
    "configuration_write",
    "corner_range",
    "crossings",
    "damping_range",
    "dde_root_number",
    "dde_roots",
    "delay_margin",
    "delay_range",
    "doubles_read",
    "doubles_write",
    "end_of_gain",
    "gain_range",
    "lambertw",
    "lambertw0",
    "lambertw0_number",
    "lambertw_derivative",
    "lambertw_log",
    "lambertw_number",
    "lambertw_offset",
    "lambertwm1",
    "lambertwm1_number",
    "largest_stable_box",
    "legendre_tables",
    "limit_threads",
    "loop_margins",
    "loop_packet_read",
    "loop_packet_write",
    "loop_sensitivities",
    "nap",
    "navdata_full",
    "navdata_layouts",
    "navdata_read",
    "navdata_write",
    "proved_boxes",
    "ratio",
    "robust_map",
    "sampled_abscissa_grid",
    "solve_delay_equation",
    "spin",
    "stability_radius",
    "sweep_figures",
    "sweep_responses",
    "thread_count",
    "wrightomega",
]

_Pair: TypeAlias = tuple[float, float]
_Axes: TypeAlias = dict[str, NDArray[np.float64]]
_Region: TypeAlias = tuple[_Pair, _Pair]

@final
class RootSet:
    @property
    def roots(self) -> NDArray[np.complex128]: ...
    @property
    def multiplicities(self) -> NDArray[np.int64]: ...
    @property
    def radii(self) -> NDArray[np.float64]: ...
    @property
    def resolved(self) -> NDArray[np.bool_]: ...
    @property
    def counted(self) -> int: ...
    @property
    def region(self) -> _Region: ...

@final
class Sensitivity:
    @property
    def root(self) -> complex: ...
    @property
    def coefficients(self) -> NDArray[np.complex128]: ...

@final
class Segment:
    @property
    def start(self) -> complex: ...
    @property
    def end(self) -> complex: ...
    @property
    def middle(self) -> complex: ...
    @property
    def reference(self) -> int: ...
    @property
    def value(self) -> complex: ...
    @property
    def error(self) -> float: ...
    @property
    def slope(self) -> float: ...

@final
class Monotone:
    @property
    def start(self) -> float: ...
    @property
    def end(self) -> float: ...
    @property
    def middle(self) -> float: ...
    @property
    def reference(self) -> int: ...
    @property
    def slope(self) -> float: ...
    @property
    def error(self) -> float: ...
    @property
    def bend(self) -> float: ...

@final
class Contour:
    @property
    def re(self) -> _Pair: ...
    @property
    def im(self) -> _Pair: ...
    @property
    def symmetric(self) -> bool: ...
    @property
    def count(self) -> int: ...
    @property
    def segments(self) -> list[Segment]: ...

@final
class Certificate:
    @property
    def region(self) -> _Region: ...
    @property
    def count(self) -> int: ...
    @property
    def scale(self) -> int: ...
    @property
    def zeros(self) -> int: ...
    @property
    def beyond(self) -> tuple[int, float] | None: ...
    @property
    def closed(self) -> _Region: ...
    @property
    def contours(self) -> list[Contour]: ...
    @property
    def real(self) -> list[Segment | Monotone]: ...

@final
class Expansion:
    @property
    def coefficients(self) -> NDArray[np.complex128]: ...
    @property
    def errors(self) -> NDArray[np.float64]: ...
    @property
    def delay(self) -> float: ...

@final
class CharacteristicMatrix:
    def __new__(
        cls,
        e: NDArray[np.float64],
        n: list[tuple[float, NDArray[np.float64]]],
        a: list[tuple[float, NDArray[np.float64]]],
    ) -> CharacteristicMatrix: ...
    def is_invertible(self) -> bool: ...
    def count(self, re: tuple[float, float], im: tuple[float, float]) -> int: ...
    def roots(self, re: tuple[float, float], im: tuple[float, float]) -> RootSet: ...
    def rightmost(self, n: int) -> RootSet: ...
    def spectral_abscissa(self) -> float: ...
    def chain_abscissa(self) -> tuple[float, float]: ...
    def is_stable(self) -> bool: ...

@final
class QuasiPolynomial:
    def __new__(
        cls, coefficients: NDArray[np.float64], delays: NDArray[np.float64]
    ) -> QuasiPolynomial: ...
    def coefficients(self) -> NDArray[np.float64]: ...
    def delays(self) -> NDArray[np.float64]: ...
    def kind(self) -> str: ...
    def degree(self) -> int: ...
    def add(self, other: QuasiPolynomial) -> QuasiPolynomial: ...
    def sub(self, other: QuasiPolynomial) -> QuasiPolynomial: ...
    def mul(self, other: QuasiPolynomial) -> QuasiPolynomial: ...
    def scale(self, factor: float) -> QuasiPolynomial: ...
    def pow(self, exponent: int) -> QuasiPolynomial: ...
    def derivative(self, order: int) -> QuasiPolynomial: ...
    def powers_of_s(self) -> int: ...
    def without_powers(self, k: int) -> QuasiPolynomial: ...
    def first_term(self) -> tuple[float, int]: ...
    def argument(self, omega: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def values(self, points: NDArray[np.complex128]) -> NDArray[np.complex128]: ...
    def count(self, re: tuple[float, float], im: tuple[float, float], edge: str) -> int: ...
    def certify(self, re: tuple[float, float], im: tuple[float, float]) -> Certificate: ...
    def is_stable(self, strong: bool) -> bool: ...
    def roots(self, re: tuple[float, float], im: tuple[float, float], edge: str) -> RootSet: ...
    def rightmost(self, n: int) -> RootSet: ...
    def spectral_abscissa(self, strong: bool) -> float: ...
    def sensitivity(self, root: complex, delays: list[float], powers: list[int]) -> Sensitivity: ...
    def chain_abscissa(self) -> float: ...
    def exact_chain_abscissa(self) -> float | None: ...
    def base_delay(self) -> float | None: ...
    def expansion(self, s: complex, order: int) -> Expansion: ...
    def logarithmic_derivatives(self, points: NDArray[np.complex128]) -> NDArray[np.complex128]: ...

@final
class Margins:
    @property
    def stable(self) -> bool: ...
    @property
    def gain_margin(self) -> float: ...
    @property
    def gain_reduction(self) -> float: ...
    @property
    def phase_margin(self) -> float: ...
    @property
    def delay_margin(self) -> float: ...
    @property
    def gain_margin_omega(self) -> float: ...
    @property
    def gain_reduction_omega(self) -> float: ...
    @property
    def phase_margin_omega(self) -> float: ...
    @property
    def delay_margin_omega(self) -> float: ...
    @property
    def gain_crossovers(self) -> NDArray[np.float64]: ...
    @property
    def phase_margins(self) -> NDArray[np.float64]: ...
    @property
    def delay_margins(self) -> NDArray[np.float64]: ...
    @property
    def phase_crossovers(self) -> NDArray[np.float64]: ...
    @property
    def gain_margins(self) -> NDArray[np.float64]: ...
    @property
    def searched(self) -> _Pair: ...

def loop_margins(n: QuasiPolynomial, d: QuasiPolynomial) -> Margins: ...
def end_of_gain(n: QuasiPolynomial, d: QuasiPolynomial, level: float) -> float: ...
def ratio(
    n: QuasiPolynomial, d: QuasiPolynomial, points: NDArray[np.complex128]
) -> NDArray[np.complex128]: ...

@final
class Crossings:
    @property
    def values(self) -> NDArray[np.float64]: ...
    @property
    def omega(self) -> NDArray[np.float64]: ...
    @property
    def direction(self) -> NDArray[np.int32]: ...
    @property
    def unlisted(self) -> list[_Pair]: ...

def crossings(family: Family, ends: _Pair) -> Crossings: ...
def delay_margin(family: Family, start: float) -> float: ...
def delay_range(family: Family, value: float) -> _Pair: ...
def gain_range(family: Family, value: float, bounds: _Pair) -> _Pair: ...
def damping_range(family: Family, value: float, highest: float) -> _Pair: ...
def corner_range(family: Family, value: float, highest: float) -> _Pair: ...
def thread_count(threads: int | None = None) -> int: ...
def spin(
    seconds: float, threads: int | None = None, progress: Callable[[int], object] | None = None
) -> int: ...
def limit_threads(threads: int | None) -> int | None: ...

lambertw: np.ufunc
lambertw0: np.ufunc
lambertwm1: np.ufunc
lambertw_log: np.ufunc
wrightomega: np.ufunc
lambertw_derivative: np.ufunc
lambertw_offset: np.ufunc
dde_roots: np.ufunc
nap: np.ufunc
__pyx_capi__: dict[str, object]

def lambertw_number(z: object, k: object) -> np.complex128 | None: ...
def lambertw0_number(x: object) -> np.float64 | None: ...
def lambertwm1_number(x: object) -> np.float64 | None: ...
def dde_root_number(a0: object, a1: object, delay: object, k: object) -> np.complex128 | None: ...

class _FamilyTerm(Protocol):
    @property
    def coefficient(self) -> float: ...
    @property
    def exponents(self) -> Sequence[tuple[str, int]]: ...
    @property
    def power(self) -> int: ...
    @property
    def constant(self) -> float: ...
    @property
    def slopes(self) -> Sequence[tuple[str, float]]: ...

class _MapQuestion(Protocol):
    @property
    def decay(self) -> float: ...
    @property
    def damping(self) -> _Pair | None: ...
    @property
    def abscissa(self) -> bool: ...
    @property
    def proof(self) -> str: ...

@final
class MapCells:
    @property
    def unstable(self) -> NDArray[np.int32]: ...
    @property
    def abscissa(self) -> NDArray[np.float64] | None: ...
    @property
    def status(self) -> NDArray[np.uint8]: ...

@final
class MapBoundary:
    @property
    def gain(self) -> NDArray[np.float64]: ...
    @property
    def row(self) -> NDArray[np.int64]: ...
    @property
    def omega(self) -> NDArray[np.float64]: ...
    @property
    def crossing(self) -> NDArray[np.int32]: ...
    @property
    def along(self) -> str: ...

@final
class Family:
    def __new__(cls, names: list[str], terms: Sequence[_FamilyTerm]) -> Family: ...
    def at(self, values: list[float]) -> QuasiPolynomial: ...
    def map(
        self,
        axes: _Axes,
        question: _MapQuestion,
        *,
        threads: int | None = None,
        progress: Callable[[int], object] | None = None,
    ) -> MapCells: ...
    def chains(self, axes: _Axes) -> NDArray[np.float64]: ...
    def boundaries(
        self, axes: _Axes, *, decay: float, damping: _Pair | None
    ) -> list[MapBoundary] | None: ...

@final
class ProvedBoxes:
    @property
    def low(self) -> NDArray[np.float64]: ...
    @property
    def high(self) -> NDArray[np.float64]: ...
    @property
    def unstable(self) -> NDArray[np.int32]: ...
    @property
    def undecided(self) -> float: ...
    @property
    def parameter(self) -> NDArray[np.int8]: ...
    @property
    def at(self) -> NDArray[np.float64]: ...
    @property
    def link(self) -> NDArray[np.int64]: ...

@final
class StabilityRadius:
    @property
    def radius(self) -> float: ...
    @property
    def upper(self) -> float: ...
    @property
    def witness(self) -> dict[str, float] | None: ...

def proved_boxes(
    family: Family,
    ranges: dict[str, _Pair],
    *,
    tol: float,
    max_boxes: int,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> ProvedBoxes: ...
def largest_stable_box(
    family: Family,
    ranges: dict[str, _Pair],
    *,
    around: dict[str, float] | None,
    tol: float,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> dict[str, _Pair] | None: ...
def stability_radius(
    family: Family,
    point: dict[str, float],
    scales: dict[str, float],
    *,
    tol: float,
    max_boxes: int,
) -> StabilityRadius: ...
def robust_map(
    family: Family,
    axes: _Axes,
    over: dict[str, _Pair],
    *,
    max_boxes: int,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> NDArray[np.int32]: ...
def fixed_step_run(
    plant: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float],
    controller: tuple[
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        float,
        float,
        float,
        float,
    ],
    delay: float,
    delay_path: str,
    limit: float | None,
    sample_steps: int | None,
    solver: str,
    step: float,
    steps: int,
    state: NDArray[np.float64],
    output: float,
    command: float,
    reference: tuple[float, NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def on_samples(
    since: NDArray[np.float64], start: float, sample_time: float, sample_phase: float
) -> NDArray[np.float64]: ...

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
        impulse: float = 0.0,
        update: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None = None,
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
    def respond(
        self,
        time: NDArray[np.float64],
        ahead: float,
        state: NDArray[np.float64],
        command: float,
        before: float,
        reference: float | tuple[NDArray[np.float64], NDArray[np.float64]],
        command_history: NDArray[np.float64] | None,
        sample_phase: float,
    ) -> tuple[
        NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
    ]: ...
    def transition_matrix(self) -> NDArray[np.float64]: ...
    def balanced_matrix(self) -> NDArray[np.float64]: ...
    def poles(self) -> NDArray[np.complex128]: ...

def loop_sensitivities(
    states: int,
    row: NDArray[np.float64],
    row_slopes: NDArray[np.float64],
    state: NDArray[np.float64],
    state_slopes: NDArray[np.float64],
    command: float,
    command_slopes: NDArray[np.float64],
    ahead: NDArray[np.float64],
    output_times: NDArray[np.float64],
    input_times: NDArray[np.float64],
    reference_before: float,
    reference_times: NDArray[np.float64],
    reference_values: NDArray[np.float64],
    command_history: NDArray[np.float64],
    sample_phase: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def sweep_figures(
    states: int,
    rows: NDArray[np.float64],
    amplitude: float,
    is_ahead: bool,
    steady: NDArray[np.float64],
    span: float,
    settling: float,
    rise: tuple[float, float],
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]: ...
def sweep_responses(
    states: int,
    rows: NDArray[np.float64],
    amplitude: float,
    is_ahead: bool,
    times: NDArray[np.float64],
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]: ...
def legendre_tables() -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

_Terms: TypeAlias = Sequence[tuple[float, NDArray[np.float64]]]

@final
class Signal:
    def __new__(
        cls, edges: NDArray[np.float64], series: NDArray[np.float64], breaks: Sequence[int]
    ) -> Signal: ...

@final
class LinearSystem:
    def __new__(
        cls,
        states: int,
        inputs: int,
        outputs: int,
        a: _Terms,
        n: _Terms,
        b: _Terms,
        c: _Terms,
        f: _Terms,
        d: _Terms,
    ) -> LinearSystem: ...
    def simulate(
        self,
        times: NDArray[np.float64],
        state: NDArray[np.float64],
        history: Signal,
        slopes: Signal | None,
        inputs: Signal,
    ) -> tuple[
        NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
    ]: ...

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
    decay: float,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]: ...

@final
class DelayPieces:
    def __new__(
        cls,
        dim: int,
        end: float,
        starts: NDArray[np.float64],
        ends: NDArray[np.float64],
        terms: NDArray[np.uint64],
        coefficients: NDArray[np.float64],
    ) -> DelayPieces: ...
    def __reduce__(self) -> tuple[type[DelayPieces], tuple[Any, ...]]: ...
    @property
    def span(self) -> tuple[float, float]: ...
    @property
    def count(self) -> int: ...
    def evaluate(self, times: NDArray[np.float64], nu: int) -> NDArray[np.float64]: ...

@final
class DelayRun:
    @property
    def times(self) -> NDArray[np.float64]: ...
    @property
    def values(self) -> NDArray[np.float64]: ...
    @property
    def event_times(self) -> list[NDArray[np.float64]]: ...
    @property
    def event_values(self) -> list[NDArray[np.float64]]: ...
    @property
    def breaks(self) -> NDArray[np.float64]: ...
    @property
    def calls(self) -> int: ...
    @property
    def nodes(self) -> int: ...
    @property
    def elements(self) -> int: ...
    @property
    def refused(self) -> int: ...
    @property
    def outcome(self) -> int: ...
    @property
    def place(self) -> float: ...
    @property
    def pieces(self) -> DelayPieces: ...

def solve_delay_equation(
    fun: Callable[..., Any] | tuple[int, int],
    args: tuple[Any, ...],
    vectorized: bool,
    span: tuple[float, float],
    initial: NDArray[np.float64],
    delays: NDArray[np.float64],
    neutral: bool,
    history: Any,
    history_slope: Callable[[float], Any] | None,
    history_breaks: NDArray[np.float64],
    tolerances: tuple[float, NDArray[np.float64]],
    longest: float,
    times: NDArray[np.float64] | None,
    keep: bool,
    sparsity: tuple[list[int], list[int]] | None,
    most: int | None,
    events: list[tuple[Any, int, int]],
    jumps: list[tuple[float, Any]],
) -> DelayRun: ...

_Words: TypeAlias = tuple[int, int, int, int]
_LoopFields: TypeAlias = tuple[int, float, int, float, float, float, float, int]

def at_write(commands: Sequence[tuple[str, tuple[Any, ...]]], first: int) -> bytes: ...
def at_read(datagram: bytes) -> list[tuple[int, str, tuple[Any, ...]]]: ...
def navdata_read(
    packet: bytes, verify: bool
) -> tuple[_Words, list[tuple[int, bytes, tuple[float, ...] | None]], bool]: ...
def navdata_write(
    head: _Words, options: Sequence[tuple[int, bytes, tuple[float, ...] | None]]
) -> bytes: ...
def navdata_layouts() -> list[tuple[int, int, str, list[str]]]: ...
def navdata_full() -> list[tuple[int, int]]: ...
def configuration_read(dump: bytes) -> list[tuple[str, str]]: ...
def configuration_write(settings: Sequence[tuple[str, str]]) -> bytes: ...
def loop_packet_read(packet: bytes) -> _LoopFields: ...
def loop_packet_write(fields: _LoopFields) -> bytes: ...
def doubles_read(packet: bytes, count: int) -> list[float]: ...
def doubles_write(values: Sequence[float]) -> bytes: ...
