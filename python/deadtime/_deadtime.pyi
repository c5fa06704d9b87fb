"""Signatures of the native part."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Protocol, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

_Pair: TypeAlias = tuple[float, float]
_Reals: TypeAlias = NDArray[np.float64]
_Complexes: TypeAlias = NDArray[np.complex128]
_Progress: TypeAlias = Callable[[int], object] | None
_Axes: TypeAlias = dict[str, _Reals]
_Region: TypeAlias = tuple[_Pair, _Pair]

# --- roots ----------------------------------------------------------------------------

@final
class RootSet:
    roots: Final[_Complexes]
    multiplicities: Final[NDArray[np.uint32]]
    radii: Final[_Reals]
    resolved: Final[NDArray[np.bool_]]
    counted: Final[int]
    region: Final[_Region]
    hidden: Final[_Complexes]

@final
class Sensitivity:
    root: Final[complex]
    coefficients: Final[_Complexes]

@final
class Segment:
    start: Final[complex]
    end: Final[complex]
    middle: Final[complex]
    reference: Final[int]
    value: Final[complex]
    error: Final[float]
    slope: Final[float]

@final
class Monotone:
    start: Final[float]
    end: Final[float]
    middle: Final[float]
    reference: Final[int]
    slope: Final[float]
    error: Final[float]
    bend: Final[float]

@final
class Contour:
    re: Final[_Pair]
    im: Final[_Pair]
    symmetric: Final[bool]
    count: Final[int]
    segments: Final[list[Segment]]

@final
class Certificate:
    region: Final[_Region]
    count: Final[int]
    scale: Final[int]
    zeros: Final[int]
    beyond: Final[tuple[int, float] | None]
    closed: Final[_Region]
    contours: Final[list[Contour]]
    real: Final[list[Segment | Monotone]]

@final
class Expansion:
    coefficients: Final[_Complexes]
    errors: Final[_Reals]
    delay: Final[float]

@final
class CharacteristicMatrix:
    def __new__(
        cls,
        e: _Reals,
        n: list[tuple[float, _Reals]],
        a: list[tuple[float, _Reals]],
    ) -> CharacteristicMatrix: ...
    def is_invertible(self) -> bool: ...
    def count(self, re: _Pair, im: _Pair, edge: str) -> int: ...
    def roots(self, re: _Pair, im: _Pair, edge: str) -> RootSet: ...
    def rightmost(self, n: int) -> RootSet: ...
    def spectral_abscissa(self, strong: bool) -> float: ...
    def chain_abscissa(self, strong: bool) -> _Pair: ...
    def is_stable(self, strong: bool) -> bool: ...

@final
class QuasiPolynomial:
    def __new__(cls, coefficients: _Reals, delays: _Reals) -> QuasiPolynomial: ...
    def coefficients(self) -> _Reals: ...
    def delays(self) -> _Reals: ...
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
    def argument(self, omega: _Reals) -> _Reals: ...
    def values(self, points: _Complexes) -> _Complexes: ...
    def count(self, re: _Pair, im: _Pair, edge: str) -> int: ...
    def certify(self, re: _Pair, im: _Pair) -> Certificate: ...
    def is_stable(self, strong: bool) -> bool: ...
    def roots(self, re: _Pair, im: _Pair, edge: str) -> RootSet: ...
    def rightmost(self, n: int) -> RootSet: ...
    def spectral_abscissa(self, strong: bool) -> float: ...
    def sensitivity(self, root: complex, delays: list[float], powers: list[int]) -> Sensitivity: ...
    def chain_abscissa(self) -> float: ...
    def exact_chain_abscissa(self) -> float | None: ...
    def base_delay(self) -> float | None: ...
    def expansion(self, s: complex, order: int) -> Expansion: ...
    def logarithmic_derivatives(self, points: _Complexes) -> _Complexes: ...

@final
class Ratio:
    def __new__(cls, n: QuasiPolynomial, d: QuasiPolynomial) -> Ratio: ...
    def count(self, re: _Pair, im: _Pair, edge: str) -> int: ...
    def poles(self, re: _Pair, im: _Pair, edge: str) -> RootSet: ...
    def rightmost(self, n: int) -> RootSet: ...
    def spectral_abscissa(self, strong: bool) -> float: ...
    def stability(self, strong: bool) -> tuple[bool, _Complexes]: ...

# --- frequencies -----------------------------------------------------------------------

@final
class Margins:
    stable: Final[bool]
    gain_margin: Final[float]
    gain_reduction: Final[float]
    phase_margin: Final[float]
    delay_margin: Final[float]
    gain_margin_omega: Final[float]
    gain_reduction_omega: Final[float]
    phase_margin_omega: Final[float]
    delay_margin_omega: Final[float]
    gain_crossovers: Final[_Reals]
    phase_margins: Final[_Reals]
    delay_margins: Final[_Reals]
    phase_crossovers: Final[_Reals]
    gain_margins: Final[_Reals]
    searched: Final[_Pair]
    hidden: Final[_Complexes]
    max_sensitivity: Final[float]
    max_sensitivity_omega: Final[float]
    max_complementary_sensitivity: Final[float]
    max_complementary_sensitivity_omega: Final[float]
    disk_margin: Final[float]
    disk_margin_omega: Final[float]

def loop_margins(n: QuasiPolynomial, d: QuasiPolynomial, all_modes: bool) -> Margins: ...
def hinf_norm(n: QuasiPolynomial, d: QuasiPolynomial) -> _Pair: ...
def end_of_gain(n: QuasiPolynomial, d: QuasiPolynomial, level: float) -> float: ...
def ratio(n: QuasiPolynomial, d: QuasiPolynomial, points: _Complexes) -> _Complexes: ...

@final
class Crossings:
    values: Final[_Reals]
    omega: Final[_Reals]
    direction: Final[NDArray[np.int32]]
    unlisted: Final[list[_Pair]]

def crossings(family: Family, ends: _Pair) -> Crossings: ...
def delay_margin(family: Family, start: float) -> float: ...
def delay_range(family: Family, value: float) -> _Pair: ...
def gain_range(family: Family, value: float, bounds: _Pair) -> _Pair: ...
def damping_range(family: Family, value: float, highest: float) -> _Pair: ...
def corner_range(family: Family, value: float, highest: float) -> _Pair: ...

# --- special functions ----------------------------------------------------------------

def limit_threads(threads: int | None) -> int | None: ...

lambertw: np.ufunc
lambertw0: np.ufunc
lambertwm1: np.ufunc
lambertw_log: np.ufunc
wrightomega: np.ufunc
lambertw_derivative: np.ufunc
lambertw_offset: np.ufunc
dde_roots: np.ufunc
__pyx_capi__: dict[str, object]

def lambertw_number(z: object, k: object) -> np.complex128 | None: ...
def lambertw0_number(x: object) -> np.float64 | None: ...
def lambertwm1_number(x: object) -> np.float64 | None: ...
def dde_root_number(a0: object, a1: object, delay: object, k: object) -> np.complex128 | None: ...

# --- families, maps and boxes ---------------------------------------------------------

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
    unstable: Final[NDArray[np.int32]]
    abscissa: Final[_Reals | None]
    status: Final[NDArray[np.uint8]]

@final
class MapBoundary:
    gain: Final[_Reals]
    row: Final[NDArray[np.int64]]
    omega: Final[_Reals]
    crossing: Final[NDArray[np.int32]]
    along: Final[str]

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
        progress: _Progress = None,
    ) -> MapCells: ...
    def chains(self, axes: _Axes) -> _Reals: ...
    def boundaries(
        self, axes: _Axes, *, decay: float, damping: _Pair | None
    ) -> list[MapBoundary] | None: ...

@final
class ProvedBoxes:
    low: Final[_Reals]
    high: Final[_Reals]
    unstable: Final[NDArray[np.int32]]
    undecided: Final[float]
    parameter: Final[NDArray[np.int8]]
    at: Final[_Reals]
    link: Final[NDArray[np.int64]]

@final
class StabilityRadius:
    radius: Final[float]
    upper: Final[float]
    witness: Final[dict[str, float] | None]

def proved_boxes(
    family: Family,
    ranges: dict[str, _Pair],
    *,
    tol: float,
    max_boxes: int,
    threads: int | None = None,
    progress: _Progress = None,
) -> ProvedBoxes: ...
def largest_stable_box(
    family: Family,
    ranges: dict[str, _Pair],
    *,
    around: dict[str, float] | None,
    tol: float,
    threads: int | None = None,
    progress: _Progress = None,
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
    progress: _Progress = None,
) -> NDArray[np.int32]: ...

_Terms: TypeAlias = Sequence[tuple[float, _Reals]]

# --- loops ----------------------------------------------------------------------------

class _SampleUpdate(Protocol):
    @property
    def states(self) -> _Reals: ...
    @property
    def command(self) -> _Reals: ...
    @property
    def reference(self) -> _Reals: ...

class _LinearEquations(Protocol):
    @property
    def A(self) -> _Reals: ...
    @property
    def B(self) -> _Reals: ...
    @property
    def C(self) -> _Reals: ...

class _EquationsWithReference(_LinearEquations, Protocol):
    @property
    def E(self) -> _Reals: ...
    @property
    def M(self) -> float: ...
    @property
    def impulse(self) -> float: ...

class _LoopEquations(_EquationsWithReference, Protocol):
    @property
    def K(self) -> _Reals: ...
    @property
    def L(self) -> float: ...
    @property
    def D(self) -> float: ...
    @property
    def update(self) -> _SampleUpdate | None: ...

#: As `deadtime.loops._runs.LoopRun`.
_LoopRun: TypeAlias = tuple[
    _Reals,
    float,
    float,
    float | _Reals,
    _Reals | None,
    _Reals | None,
    float,
    tuple[_Reals, list[int], _Reals] | None,
]

@final
class LoopResponse:
    @property
    def start(self) -> float | None: ...
    @property
    def time(self) -> _Reals: ...
    @property
    def outputs(self) -> _Reals: ...
    @property
    def inputs(self) -> _Reals: ...
    @property
    def breaks(self) -> _Reals: ...
    @property
    def reference(self) -> _Reals: ...

@final
class Candidates:
    def __new__(cls, loops: list[Loop], free: list[int]) -> Candidates: ...
    def costs(self, points: _Reals, objective: str, threads: int | None) -> _Reals: ...
    def all_margins(self, points: _Reals, threads: int | None) -> _Reals: ...
    def margins(self, gains: list[float], delay_margin: bool) -> _Reals: ...
    def dominant(self, gains: list[float]) -> _Reals: ...

class _GainQuestion(Protocol):
    @property
    def loops(self) -> list[Loop]: ...
    @property
    def free(self) -> list[int]: ...
    @property
    def corners(self) -> list[int]: ...
    @property
    def fine(self) -> list[int]: ...
    @property
    def places(self) -> list[int] | None: ...
    @property
    def objective(self) -> str: ...
    @property
    def required(self) -> tuple[float, float, float]: ...
    @property
    def amplitude(self) -> float: ...
    @property
    def axes(self) -> Sequence[_Reals]: ...
    @property
    def abscissa(self) -> _Reals: ...
    @property
    def threads(self) -> int | None: ...

#: The place of a loop among those of the question, and a delay.
_Spot: TypeAlias = tuple[int, float]

@final
class FoundGains:
    gains: Final[list[float]]
    scenarios: Final[list[_Spot]]
    cost: Final[float]
    worst: Final[_Spot]
    checked: Final[int]
    value: Final[float]

@final
class UnmetMargins:
    alone: Final[list[float]]
    gains: Final[list[float]]
    together: Final[list[float]]

@final
class GainSearch:
    def __new__(cls, question: _GainQuestion) -> GainSearch: ...
    def best(self, start: list[float] | None = None) -> FoundGains | UnmetMargins: ...
    def best_in(self, scenarios: list[_Spot], required: tuple[float, float, float]) -> float: ...
    def proved_steps(self, scenarios: list[_Spot], gains: list[float]) -> list[_Pair | None]: ...

def proved_step(of: Loop, amplitude: float) -> _Pair | None: ...

LOAD_SLACK: Final[float]

@final
class RobustGains:
    gains: Final[list[float]]
    value: Final[float]
    least: Final[float]
    worst: Final[int]
    margins: Final[list[Margins]]
    weight: Final[float | None]

def robust_gains(
    loops: list[Loop],
    first: int,
    free: list[int],
    wish: tuple[float, bool, bool],
    demands: tuple[float, float, float, float, float, float, float],
    bounds: list[_Pair] | None = None,
    threads: int | None = None,
    *,
    slack: float | None = None,
    weight: float | None = None,
) -> RobustGains: ...
def noise_gain(of: Loop, bandwidth: float) -> float: ...
def lasting_load(of: Loop) -> float: ...
def tuning_rules(
    of: Loop,
) -> list[tuple[str, list[float] | None, float, float, float, float]]: ...
def half_rule(of: Loop, with_second: bool) -> tuple[float, float, float, float] | None: ...

@final
class LinearLoop:
    def __new__(
        cls,
        equations: _LoopEquations,
        delay: float,
        sample_time: float | None = None,
        limit: float | None = None,
        delay_in_measurement: bool = False,
    ) -> LinearLoop: ...
    def equations(self) -> tuple[tuple[Any, ...], tuple[_Reals, _Reals, _Reals] | None]: ...
    def outputs(self, time: _Reals, run: _LoopRun) -> _Reals: ...
    def respond(self, time: _Reals, run: _LoopRun | float) -> LoopResponse: ...
    def transition_matrix(self) -> _Reals: ...
    def poles(self) -> _Complexes: ...
    def poles_in(self, re: _Pair, im: _Pair) -> RootSet: ...
    def rightmost(self, n: int) -> RootSet: ...
    def is_stable(self) -> bool | None: ...
    def held_gain(self, omega: _Reals) -> _Complexes: ...
    def held_phase(self, omega: _Reals) -> _Reals: ...
    def abscissa(self) -> float: ...
    def held_margins(self, delay_margin: bool) -> Margins: ...
    def further_delay(self) -> _Pair: ...

def on_samples(since: _Reals, start: float, sample_time: float, sample_phase: float) -> _Reals: ...
def rate_limited(
    time: _Reals, command: _Reals, rate: float, rate_of_rate: float
) -> tuple[_Reals, _Reals]: ...

class _FixedStepSettings(Protocol):
    @property
    def delay(self) -> float: ...
    @property
    def delay_path(self) -> str: ...
    @property
    def bounds(self) -> _Pair | None: ...
    @property
    def inputs(self) -> list[tuple[_Reals, _Reals]]: ...
    @property
    def sample_steps(self) -> int | None: ...
    @property
    def solver(self) -> str: ...
    @property
    def step(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def initial_output(self) -> float: ...

@final
class FixedStepResponse:
    outputs: Final[_Reals]
    inputs: Final[_Reals]

@final
class LoopSensitivities:
    outputs: Final[_Reals]
    inputs: Final[_Reals]

class _Disturbance(Protocol):
    @property
    def at_input(self) -> bool: ...
    @property
    def time_constant(self) -> float: ...
    @property
    def deviation(self) -> float: ...

class _BankSettings(Protocol):
    @property
    def plant(self) -> FlightPlant: ...
    @property
    def delays(self) -> Sequence[float]: ...
    @property
    def layers(self) -> Sequence[tuple[Sequence[float], float, Sequence[float]]]: ...
    @property
    def disturbances(self) -> Sequence[_Disturbance]: ...
    @property
    def gain(self) -> tuple[float, float]: ...
    @property
    def trim(self) -> float: ...
    @property
    def white(self) -> float: ...
    @property
    def freedom(self) -> float: ...
    @property
    def memory(self) -> float: ...
    @property
    def drift(self) -> float: ...
    @property
    def gain_walk(self) -> float: ...
    @property
    def width(self) -> float: ...
    @property
    def alarm(self) -> float: ...
    @property
    def every(self) -> int: ...
    @property
    def at_rest(self) -> bool: ...
    @property
    def level(self) -> float: ...

@final
class BankAnswer:
    @property
    def shown(self) -> dict[str, Any]: ...
    @property
    def informed(self) -> bool: ...
    @property
    def started(self) -> bool: ...
    @property
    def changed(self) -> bool: ...
    @property
    def time(self) -> float: ...
    @property
    def delay(self) -> float: ...
    @property
    def delay_deviation(self) -> float: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...
    @property
    def together(self) -> float: ...
    @property
    def together_low(self) -> float: ...
    @property
    def together_high(self) -> float: ...
    @property
    def lag(self) -> float: ...
    @property
    def gain(self) -> float: ...
    @property
    def gain_deviation(self) -> float: ...
    @property
    def gate(self) -> float: ...
    @property
    def white(self) -> float: ...
    @property
    def colour(self) -> float: ...
    @property
    def unexplained(self) -> float: ...
    @property
    def lowest(self) -> float: ...
    @property
    def highest(self) -> float: ...
    @property
    def evidence(self) -> float: ...

@final
class OnlineBank:
    def __new__(cls, settings: _BankSettings) -> OnlineBank: ...
    def command(self, time: float, value: float) -> None: ...
    def row(self, time: float, output: float | None = None) -> BankAnswer: ...

@final
class HeldCommands:
    def __new__(cls, sent: tuple[Any, ...], controlled: tuple[Any, ...] | None) -> HeldCommands: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    @staticmethod
    def with_times(
        time: _Reals, command: _Reals, rows: _Reals, integrates: bool, complete: bool
    ) -> HeldCommands: ...
    @staticmethod
    def of_rows(
        time: _Reals,
        reference: _Reals,
        output: _Reals,
        command: _Reals,
        *,
        sample_time: float | None,
        gain: float,
        is_proportional: bool,
        limit: float,
        window: _Reals,
        integrates: bool,
    ) -> HeldCommands: ...
    @property
    def time(self) -> _Reals: ...
    @property
    def command(self) -> _Reals: ...
    @property
    def unknown(self) -> int: ...
    @property
    def lost(self) -> int: ...
    @property
    def are_computed(self) -> bool: ...

@final
class RowNoise:
    air_time: Final[float]
    air: Final[float]
    sensor_time: Final[float]
    sensor: Final[float]
    stamps: Final[float]
    arrivals: Final[float]
    def __new__(
        cls,
        air_time: float = 1.0,
        air: float = 0.0,
        sensor_time: float = 1.0,
        sensor: float = 0.0,
        stamps: float = 0.0,
        arrivals: float = 0.0,
    ) -> RowNoise: ...
    def __getnewargs__(self) -> tuple[float, float, float, float, float, float]: ...

@final
class PlantNumbers:
    delay: Final[float]
    lags: Final[list[float]]
    zero: Final[float]
    gain: Final[float]
    noise: Final[list[RowNoise]]
    objective: Final[float]
    def __new__(
        cls,
        delay: float,
        lags: Sequence[float],
        noise: Sequence[RowNoise],
        gain: float = 1.0,
        zero: float = 0.0,
        objective: float = ...,
    ) -> PlantNumbers: ...
    def __getnewargs__(
        self,
    ) -> tuple[float, list[float], list[RowNoise], float, float, float]: ...

@final
class RowLikelihood:
    objective: Final[float]
    log_det: Final[float]
    variance: Final[float]
    freedom: Final[int]
    gain: Final[float]
    linear: Final[list[float]]
    inverse: Final[_Reals]
    score: Final[_Reals]
    whitened: Final[_Reals]
    residuals: Final[_Reals]
    rate: Final[_Reals]

@final
class FlightPlant:
    num: Final[list[float]]
    den: Final[list[float]]
    lag_names: Final[list[str]]
    lags: Final[list[float]]
    names: Final[list[str]]
    zero: Final[float]
    own_lag: Final[float]
    air_behind_lags: Final[bool]
    def __new__(
        cls,
        num: Sequence[float],
        den: Sequence[float],
        lag_names: Sequence[str],
        lags: Sequence[float],
        names: Sequence[str],
        zero: float = 0.0,
        own_lag: float = 0.0,
        air_behind_lags: bool = False,
    ) -> FlightPlant: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    @property
    def integrates(self) -> bool: ...

@final
class FlightRows:
    def __new__(
        cls,
        time: _Reals,
        output: _Reals,
        used: NDArray[np.bool_],
        command_time: _Reals,
        command: _Reals,
        unknown: Sequence[_Pair],
        offset: bool,
        rounding: float = 0.0,
        uncertain: Sequence[tuple[float, float, float]] = ...,
        speed: _Reals | None = None,
    ) -> FlightRows: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    @staticmethod
    def read(
        time: _Reals,
        output: _Reals,
        repeated: Sequence[int],
        commands: HeldCommands,
        start: float | None,
    ) -> FlightRows: ...
    def under(self, time: _Reals, command: _Reals) -> FlightRows: ...
    @property
    def used(self) -> NDArray[np.bool_]: ...
    @property
    def count(self) -> int: ...
    @property
    def left_out(self) -> int: ...
    @property
    def rounding(self) -> float: ...
    @property
    def offset(self) -> bool: ...

_Given: TypeAlias = Callable[[list[float]], tuple[FlightPlant, Sequence[FlightRows]]]

@final
class FlightFit:
    def __new__(
        cls,
        plant: FlightPlant,
        runs: Sequence[FlightRows],
        trim: bool,
        numbers: PlantNumbers,
        given_gain: float | None = None,
    ) -> FlightFit: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    @staticmethod
    def first(
        given: _Given, numbers: Sequence[float], delay: float, gain: float
    ) -> tuple[FlightFit, list[float]]: ...
    def beside_noise(self) -> FlightFit: ...
    def with_numbers(
        self, given: _Given, numbers: Sequence[tuple[str, float]]
    ) -> tuple[FlightFit, FreeNumbers | None]: ...
    def between_rows(
        self, commands: Sequence[HeldCommands], searches: bool
    ) -> tuple[FlightFit, bool, list[float] | None]: ...
    def on(self, runs: Sequence[FlightRows]) -> FlightFit: ...
    @property
    def plant(self) -> FlightPlant: ...
    @property
    def runs(self) -> list[FlightRows]: ...
    @property
    def numbers(self) -> PlantNumbers: ...
    @property
    def trim(self) -> bool: ...
    @property
    def is_long(self) -> bool: ...
    @property
    def gain(self) -> float: ...
    @property
    def with_gain(self) -> PlantNumbers: ...
    @property
    def criterion(self) -> float: ...
    def schwarz(self, unknown: int) -> float: ...
    @property
    def parts(self) -> list[RowLikelihood]: ...
    @property
    def initial_output(self) -> float: ...
    @property
    def unseen_lag(self) -> float: ...
    @property
    def values(self) -> dict[str, float]: ...
    def explains_less(self, white: FlightFit) -> bool: ...
    @property
    def is_rounding_alone(self) -> bool: ...
    def leaves_less_than(self, share: float) -> bool: ...
    def noise_in_units(self, run: int) -> list[float]: ...
    def scatter(self, stamps: bool) -> float: ...
    def profile(
        self,
        first: Sequence[str] | None = None,
        covariance: Sequence[float] | None = None,
        numbers: FreeNumbers | None = None,
    ) -> FlightProfile: ...

@final
class FreeNumbers:
    def __new__(
        cls,
        names: Sequence[str],
        values: Sequence[float],
        cov: Sequence[float],
        slopes: Sequence[tuple[int, Sequence[float]]],
    ) -> FreeNumbers: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    @property
    def values(self) -> list[tuple[str, float]]: ...

@final
class FlightProfile:
    @staticmethod
    def restored(
        fit: FlightFit,
        known: Sequence[tuple[str, Sequence[float]]],
        covariance: Sequence[float],
        weights: Sequence[Sequence[float]],
        is_of_plant: bool,
        numbers: FreeNumbers | None,
        ends: Sequence[tuple[str, float, _Pair]],
    ) -> FlightProfile: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    @property
    def fit(self) -> FlightFit: ...
    @property
    def numbers(self) -> FreeNumbers | None: ...
    @property
    def is_plain(self) -> bool: ...
    @property
    def preferred(self) -> str: ...
    @property
    def cov(self) -> _Reals: ...
    @property
    def bounds(self) -> list[tuple[str, float]]: ...
    @property
    def stderr(self) -> list[tuple[str, float]]: ...
    def freedom_of(self, name: str) -> float: ...
    def statistic(self, name: str, value: float) -> float: ...
    def interval(
        self, name: str, _value: float, _stderr: float, level: float
    ) -> tuple[float, float]: ...
    def coloured(self) -> FlightProfile: ...
    def judge(self) -> FlightJudgement: ...

@final
class FlightFinding:
    cause: Final[str]
    run: Final[int | None]
    sizes: Final[list[float]]
    p_value: Final[float]
    is_against: Final[bool]
    plant_lacks: Final[bool]

@final
class FlightJudgement:
    whiteness: Final[tuple[float, float, int, float]]
    is_coloured: Final[bool]
    findings: Final[list[FlightFinding]]

def whiteness(pieces: Sequence[_Reals], parameters: int) -> tuple[float, float, int, float]: ...

LEVEL_OF_TESTS: Final[float]
LONGEST_DELAY: Final[float]
MOST_NUMBERS: Final[int]

@final
class FamilyCandidate:
    plant: Final[str]
    integrating: Final[bool]
    order: Final[int]
    has_zero: Final[bool]
    names: Final[list[str]]
    values: Final[_Reals]
    errors: Final[_Reals]
    covariance: Final[_Reals]
    quantile: Final[float]
    dispersion: Final[float]
    complex_poles: Final[bool]
    lags: Final[list[float]]
    pole_frequency: Final[float]
    pole_damping: Final[float]
    noise: Final[str]
    ar: Final[list[float]]
    ma: Final[list[float]]
    noise_std: Final[float]
    noise_stds: Final[list[float]]
    innovation_std: Final[float]
    deviance: Final[float]
    bic: Final[float]
    parameters: Final[int]
    told: Final[int]
    whiteness: Final[float]
    residuals: Final[list[_Reals]]
    fitted: Final[list[_Reals]]
    limit: Final[str]
    def plant_of(
        self, values: Sequence[float]
    ) -> tuple[float, float, list[float], float, _Pair | None]: ...

@final
class FamilyFit:
    candidates: Final[list[FamilyCandidate]]
    shown: Final[dict[str, Any]]
    verdict: Final[str]
    reason: Final[str]
    reason_size: Final[float]
    shift: Final[int]
    kind: Final[str]
    kind_decided: Final[bool]
    rows: Final[int]
    first_rows: Final[list[int]]
    causes: Final[list[tuple[str, float, float, float, int, float, list[str]]]]
    sensor_faults: Final[list[tuple[str, int, int, float, float, float]]]
    at_rest: Final[bool]
    told: Final[int]
    asked: Final[int]
    excited: Final[_Reals]
    omega: Final[_Reals]
    hull: Final[dict[str, _Pair]]
    crossover: Final[float]
    largest_gain: Final[float]
    gain_at_crossover: Final[float]
    phase_at_crossover: Final[float]
    delay_at_crossover: Final[float]
    def hull_at(self, level: float) -> dict[str, _Pair]: ...
    def mean_delay(
        self, omega: Sequence[float], weight: Sequence[float], level: float | None = None
    ) -> tuple[float, float, float]: ...
    def pieces_at(self, level: float) -> dict[str, list[_Pair]]: ...
    def at(
        self, omega: Sequence[float], level: float | None = None
    ) -> dict[str, tuple[_Reals, _Reals, _Reals]]: ...

def fit_family(
    records: Sequence[tuple[_Reals, _Reals, _Reals, int, _Reals | None, float]],
    *,
    between: str = "held",
    closed_loop: bool = False,
    at_rest: bool | None = None,
    largest_delay: float | None = None,
    plant: str | None = None,
    integrates: bool | None = None,
    noise: str | None = None,
    level: float = 0.95,
    causes: bool = False,
    omega: Sequence[float] | None = None,
    progress: _Progress = None,
    known: FamilyFit | None = None,
) -> FamilyFit: ...
def whitened_columns(
    num: Sequence[float],
    den: Sequence[float],
    disturbances: Sequence[_Disturbance],
    time: _Reals,
    columns: _Reals,
) -> _Reals: ...
def follows_command(
    command: tuple[_Reals, _Reals],
    rows: tuple[_Reals, _Reals, float],
    own: _Pair,
    plant: tuple[Sequence[float], Sequence[float]],
    noise: RowNoise | None,
    lead: float,
) -> bool: ...
def independent_samples(samples: float, autocorrelation: float) -> float: ...
def felt_plant(
    num: Sequence[float],
    den: Sequence[float],
    delay: float,
    omega: Sequence[float],
) -> list[_Reals]: ...
def regular_times(time: _Reals, between: float) -> _Reals | None: ...
def coarse_step(output: _Reals, noise: float) -> float: ...
def mixture_interval(
    parts: Sequence[tuple[float, float, float, float]],
    level: float,
    ends: _Pair,
    tolerance: float,
) -> _Pair: ...
def interval_end(
    excess: Callable[[float], float],
    start: float,
    step: float,
    floor: float,
    farthest: float,
    tolerance: float,
) -> float: ...
def most_moved(values: _Reals, count: int) -> int: ...
def secant_ends(
    moved: Callable[[list[float]], Sequence[float]], cov: _Reals, reach: float
) -> list[_Reals]: ...
def shared_number(
    total: Callable[[float], float],
    ends: _Pair,
    steps: int,
    rise: float,
    floor: float,
    tolerance: float,
) -> tuple[float, float, _Pair]: ...

@final
class KnownFilter:
    @staticmethod
    def inverted(b: Sequence[float], a: Sequence[float]) -> tuple[KnownFilter | None, bool]: ...
    @property
    def late(self) -> float: ...
    @property
    def remaining(self) -> float: ...
    @property
    def start(self) -> int: ...
    @property
    def together(self) -> int: ...
    def undone(self, output: _Reals) -> _Reals: ...

def held_response(
    num: Sequence[float],
    den: Sequence[float],
    input_time: _Reals,
    inputs: _Reals,
    times: _Reals,
) -> _Reals: ...

_SimulatedRows: TypeAlias = tuple[tuple[_Reals, _Reals, _Reals, _Reals], tuple[float, float, float]]

@final
class LoopMisfit:
    def __new__(
        cls,
        control: Loop,
        rows: _SimulatedRows,
        names: Sequence[str],
        start: float | None,
        *,
        is_smooth: bool,
        polynomials: Any = None,
    ) -> LoopMisfit: ...

@final
class ChebyshevMisfit:
    def __new__(
        cls,
        time: _Reals,
        output: _Reals,
        steps: Sequence[_Pair],
        *,
        names: Sequence[str],
        known: Mapping[str, float],
        start: float | None,
        intervals: int,
        is_late: bool,
        units: Sequence[float],
    ) -> ChebyshevMisfit: ...

_LineNumbers: TypeAlias = tuple[Sequence[str], Mapping[str, float], float]

@final
class LinesMisfit:
    @staticmethod
    def of_record(
        numbers: _LineNumbers,
        commands: tuple[_Reals, _Reals],
        time: _Reals,
        output: _Reals,
        last: int | None,
    ) -> LinesMisfit: ...
    @staticmethod
    def of_periods(
        numbers: _LineNumbers,
        command: _Reals,
        output: _Reals,
        samples: int,
        lines: Sequence[int],
    ) -> LinesMisfit: ...

@final
class CommandedMisfit:
    def __new__(
        cls,
        time: _Reals,
        output: _Reals,
        commands: tuple[_Reals, _Reals],
        *,
        plant: tuple[Sequence[float], Sequence[float]] | None,
        slow: str,
        is_limited: bool,
        names: Sequence[str],
        known: Mapping[str, float],
        start: float | None,
    ) -> CommandedMisfit: ...

@final
class RoundedReadings:
    def __new__(
        cls,
        output: Sequence[float] | _Reals,
        recording: Sequence[int] | NDArray[np.intp],
        used: Sequence[bool] | NDArray[np.bool_],
        steps: Sequence[float],
    ) -> RoundedReadings: ...
    @staticmethod
    def of_rows(
        first: Sequence[FlightRows],
        fitted: Sequence[FlightRows],
        repeated: Sequence[Sequence[int]],
    ) -> RoundedReadings: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    @property
    def count(self) -> int: ...

@final
class RoundedPeak:
    def __new__(
        cls, value: float, point: Sequence[float], logs: Sequence[float], cov: Sequence[float]
    ) -> RoundedPeak: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
    @property
    def value(self) -> float: ...
    @property
    def point(self) -> _Reals: ...
    @property
    def noise(self) -> list[float]: ...
    @property
    def cov(self) -> _Reals: ...

class _FittedPart(Protocol):
    @property
    def kernel(self) -> Any: ...
    @property
    def length(self) -> int: ...
    @property
    def every_end(self) -> Sequence[tuple[float, float, Sequence[float]]]: ...

@final
class LeastSquaresMinimum:
    point: Final[_Reals]
    misfit: Final[_Reals]
    jacobian: Final[_Reals]
    def __new__(cls, point: _Reals, misfit: _Reals, jacobian: _Reals) -> LeastSquaresMinimum: ...
    def spreads(self, loose: Sequence[int], sizes: Sequence[int]) -> list[_Reals]: ...
    @property
    def cost(self) -> float: ...

@final
class LeastSquares:
    def __new__(
        cls,
        parts: Sequence[_FittedPart],
        weights: Sequence[float],
        names: Sequence[str],
    ) -> LeastSquares: ...
    def bounds(self) -> tuple[_Reals, _Reals]: ...
    def misfit(self, point: _Reals) -> _Reals: ...
    def jacobian(self, point: _Reals) -> _Reals: ...
    def solve(self) -> LeastSquaresMinimum: ...
    def by_scatter(self, first: LeastSquaresMinimum) -> tuple[list[float], LeastSquaresMinimum]: ...
    def without_vanishing(self, found: LeastSquaresMinimum, size: float) -> LeastSquaresMinimum: ...
    def least_held(
        self, best: LeastSquaresMinimum, places: Sequence[int], value: float
    ) -> float: ...
    def likeliest_rounded(self, readings: RoundedReadings, start: _Reals) -> RoundedPeak: ...
    def rounded_held(
        self, readings: RoundedReadings, peak: RoundedPeak, places: Sequence[int], value: float
    ) -> float: ...
    def scan(
        self, delays: _Reals, guess: _Reals, rounding: float
    ) -> tuple[_Reals, list[int], LeastSquaresMinimum]: ...

_Peak: TypeAlias = tuple[float, float, float, float]
_Delays: TypeAlias = tuple[int, int]

def step_extremes(since: _Reals, beyond: _Reals, noise: float) -> list[_Peak]: ...
def extremes_decay(extremes: Sequence[_Peak]) -> bool: ...
def loop_of_extremes(
    extremes: Sequence[_Peak], lag: float, sample_time: float | None
) -> tuple[_Pair, tuple[list[float], list[float]] | None]: ...
def step_tail(
    since: _Reals, travelled: _Reals, share: float, most: float, clear: float, fewest: int
) -> tuple[int, tuple[float, float, float] | None]: ...
def first_movement(travelled: _Reals, least: float) -> int | None: ...
def line_through(since: _Reals, travelled: _Reals, shares: _Pair) -> float: ...
def delay_of_rate(
    rate: float, stiffness: float, lag: float, sample_time: float | None
) -> _Pair: ...
def x_of_overshoot(overshoot: float) -> float | None: ...
def rise_tangent(
    since: _Reals, travelled: _Reals, guess: float, held: float | None, noise: float
) -> tuple[_Pair | None, tuple[int, float, float] | None]: ...

@final
class LimitCycle:
    def __new__(
        cls, time: _Reals, output: _Reals, reference: _Reals, noise: float, left_out: int
    ) -> LimitCycle: ...
    @property
    def crossings(self) -> _Reals: ...
    @property
    def peaks(self) -> _Reals: ...
    def switches(self, signs: _Reals) -> tuple[list[int], list[float]]: ...
    def delays(self, switches: _Reals) -> tuple[int, float, float]: ...
    def path(
        self, switches: _Reals, delay: float, lag: float
    ) -> tuple[list[int], _Reals, _Reals, float] | None: ...
    @staticmethod
    def delay_by_lag(lag: float, half: float) -> float: ...

@final
class PathAt:
    value: Final[_Reals]
    rate: Final[_Reals]
    by_lag: Final[_Reals]

@final
class HeldResponse:
    def __new__(cls, time: _Reals, command: _Reals) -> HeldResponse: ...
    def at(self, times: _Reals, lag: float = 0.0) -> PathAt: ...

def arx_losses(
    output: _Reals, command: _Reals, orders: _Delays, delays: _Delays
) -> tuple[_Reals, float, float]: ...
def held_losses(
    response: _Reals, command: _Reals, delays: _Delays
) -> tuple[float, _Reals, float]: ...
def correlation_peak(
    command: _Reals, response: _Reals, weighting: str, shifts: _Delays
) -> tuple[int, float]: ...
def correlation_coefficient(command: _Reals, response: _Reals, shift: int) -> _Pair: ...
def feedback_test(
    command: _Reals, reference: _Reals, output: _Reals
) -> tuple[float, int, int] | None: ...

class _LoopSets(Protocol):
    @property
    def values(self) -> dict[str, _Reals]: ...
    @property
    def given(self) -> tuple[list[Any], list[Any]] | None: ...
    @property
    def size(self) -> int: ...
    @property
    def amplitude(self) -> float: ...

@final
class SweepMetrics:
    metrics: Final[_Reals]
    status: Final[NDArray[np.uint8]]
    span: Final[float]

@final
class SweepResponses:
    outputs: Final[_Reals]
    status: Final[NDArray[np.uint8]]

class _PlantForm(Protocol):
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def num(self) -> Sequence[float] | None: ...
    @property
    def den(self) -> Sequence[float] | None: ...
    @property
    def lags(self) -> int: ...
    @property
    def has_zero(self) -> bool: ...
    @property
    def has_pair(self) -> bool: ...
    @property
    def delayed(self) -> tuple[QuasiPolynomial, QuasiPolynomial] | None: ...

class _ControllerForm(Protocol):
    @property
    def kind(self) -> str: ...
    @property
    def is_filtered(self) -> bool: ...
    @property
    def rule(self) -> str | None: ...
    @property
    def extras(self) -> Sequence[str]: ...
    @property
    def stops(self) -> bool: ...

class _CommandBounds(Protocol):
    limit: float | None
    low: float | None
    rate: float | None

#: Numerator and denominator of a plant, descending.
_Fraction: TypeAlias = tuple[list[Any], list[Any]]

#: They for numbers of the plant.
_Polynomials: TypeAlias = Callable[[list[float]], _Fraction | None]

@final
class Loop:
    def __new__(
        cls,
        plant: _PlantForm,
        controller: _ControllerForm,
        numbers: tuple[list[float], list[float]],
        *,
        delay: float,
        sample_time: float | None,
        bounds: _CommandBounds,
        is_measured: bool,
        given: _Fraction | None = None,
    ) -> Loop: ...
    def at(self, numbers: dict[str, float], given: _Fraction | None = None) -> Loop: ...
    def at_each(
        self, numbers: list[dict[str, float]], given: list[_Fraction | None]
    ) -> list[Loop]: ...
    def check(self) -> None: ...
    @property
    def linear(self) -> LinearLoop: ...
    def rest_gains(self) -> _Pair: ...
    def rest(self, output: float, reference: float) -> tuple[_Reals, float]: ...
    def slowest_time(self) -> float: ...
    def characteristic(self) -> QuasiPolynomial: ...
    def gain(self) -> tuple[QuasiPolynomial, QuasiPolynomial]: ...
    def transfer(self, of: str) -> tuple[QuasiPolynomial, QuasiPolynomial]: ...
    def terms(
        self, names: list[str], given: _Fraction | None = None
    ) -> list[tuple[float, list[int], int, float, list[float]]]: ...
    def plane(self, axes: _Axes, given: _Polynomials | None = None) -> HeldPlane: ...
    def stable_range(
        self, name: str, free: _Fraction | None = None, given: _Polynomials | None = None
    ) -> _Pair: ...
    def outputs(
        self,
        numbers: dict[str, float],
        time: _Reals,
        reference: _Reals,
        reference_time: _Reals,
        initial_output: float,
        *,
        command_history: _Reals,
        sample_phase: float,
        given: _Fraction | None = None,
    ) -> _Reals: ...
    def sensitivities(
        self,
        names: list[str],
        run: _LoopRun,
        rest: _Pair,
        output_time: _Reals,
        input_time: _Reals,
        given: list[_Fraction] | None = None,
    ) -> LoopSensitivities: ...
    def fixed_step(self, run: _LoopRun, settings: _FixedStepSettings) -> FixedStepResponse: ...
    def sweep_metrics(
        self,
        sets: _LoopSets,
        *,
        span: float | None,
        settling: float,
        rise: _Pair,
        threads: int | None = None,
        progress: _Progress = None,
    ) -> SweepMetrics: ...
    def stays_settled(
        self, times: _Reals, commands: _Reals, command: float, settled: float
    ) -> bool: ...
    def sweep_responses(
        self,
        sets: _LoopSets,
        time: _Reals,
        *,
        threads: int | None = None,
        progress: _Progress = None,
    ) -> SweepResponses: ...

@final
class HeldPlane:
    def cells(
        self,
        question: _MapQuestion,
        *,
        threads: int | None = None,
        progress: _Progress = None,
    ) -> MapCells: ...
    def boundaries(self, decay: float, damping: _Pair | None) -> list[MapBoundary]: ...

class _DeviationQuestion(Protocol):
    @property
    def of(self) -> str: ...
    @property
    def size(self) -> float: ...
    @property
    def band(self) -> float: ...
    @property
    def span(self) -> float | None: ...

@final
class DeviationFigures:
    peak: Final[float]
    peak_time: Final[float]
    iae: Final[float]
    ie: Final[float]
    recovery_time: Final[float]
    rest: Final[float]
    span: Final[float]
    is_settled: Final[bool]

@final
class SweepFigures:
    figures: Final[_Reals]
    status: Final[NDArray[np.uint8]]

def driven_loop(of: Loop, inputs: list[tuple[str, int]]) -> LinearLoop: ...
def deviation_figures(of: Loop, asked: _DeviationQuestion) -> DeviationFigures: ...
def sweep_deviations(
    of: Loop,
    sets: _LoopSets,
    asked: _DeviationQuestion,
    *,
    threads: int | None = None,
    progress: _Progress = None,
) -> SweepFigures: ...
def plant_polynomials(
    plant: _PlantForm, numbers: list[float]
) -> tuple[list[float], list[float]]: ...
def first_duration(a: _Reals, delay: float) -> float: ...
def canonical_form(
    num: list[float], den: list[float], output: float = 0.0
) -> tuple[_Reals, _Reals, float, _Reals, float]: ...
def feedback_polynomials(
    controller: _ControllerForm, numbers: list[float]
) -> tuple[list[float], list[float]]: ...
def sampled_filter(
    f: _Reals, g: _Reals, c: _Reals, sample_time: float, rule: str
) -> tuple[_Reals, _Reals, _Reals, float]: ...

# --- systems --------------------------------------------------------------------------

@final
class FittedSeries:
    edges: Final[_Reals]
    series: Final[_Reals]
    breaks: Final[list[int]]

def fitted_series(
    name: str,
    sample: Callable[[_Reals], _Reals],
    *,
    span: _Pair,
    breaks: list[float],
    gap: float,
    width: int,
) -> FittedSeries: ...

@final
class Signal:
    def __new__(cls, edges: _Reals, series: _Reals, breaks: Sequence[int]) -> Signal: ...

class _SystemMatrices(Protocol):
    @property
    def states(self) -> int: ...
    @property
    def inputs(self) -> int: ...
    @property
    def outputs(self) -> int: ...
    @property
    def A(self) -> _Terms: ...
    @property
    def N(self) -> _Terms: ...
    @property
    def B(self) -> _Terms: ...
    @property
    def C(self) -> _Terms: ...
    @property
    def F(self) -> _Terms: ...
    @property
    def D(self) -> _Terms: ...

@final
class LinearSystemResponse:
    outputs: Final[_Reals]
    states: Final[_Reals]
    inputs: Final[_Reals]
    breaks: Final[_Reals]

@final
class LinearSystem:
    def __new__(cls, matrices: _SystemMatrices) -> LinearSystem: ...
    def simulate(
        self,
        time: _Reals,
        state: _Reals,
        history: Signal,
        history_derivative: Signal | None,
        inputs: Signal,
    ) -> LinearSystemResponse: ...

# --- delay differential equations -----------------------------------------------------

@final
class DelayPieces:
    def __new__(
        cls,
        dim: int,
        end: float,
        starts: _Reals,
        ends: _Reals,
        terms: NDArray[np.uint64],
        coefficients: _Reals,
    ) -> DelayPieces: ...
    def __reduce__(self) -> tuple[type[DelayPieces], tuple[Any, ...]]: ...
    span: Final[_Pair]
    count: Final[int]
    def evaluate(self, times: _Reals, nu: int) -> _Reals: ...

class _DelayEvent(Protocol):
    @property
    def function(self) -> Callable[..., Any]: ...
    @property
    def direction(self) -> int: ...
    @property
    def terminal(self) -> int: ...

class _DelayJump(Protocol):
    @property
    def time(self) -> float: ...
    @property
    def change(self) -> Callable[..., Any] | None: ...

class _DelayProblem(Protocol):
    @property
    def fun(self) -> Any: ...
    @property
    def t_span(self) -> _Pair: ...
    @property
    def history(self) -> Any: ...
    @property
    def history_derivative(self) -> Callable[..., Any] | None: ...
    @property
    def delays(self) -> _Reals: ...
    @property
    def y0(self) -> _Reals: ...
    @property
    def neutral(self) -> bool: ...
    @property
    def rtol(self) -> float: ...
    @property
    def atol(self) -> _Reals: ...
    @property
    def t_eval(self) -> _Reals | None: ...
    @property
    def dense_output(self) -> bool: ...
    @property
    def events(self) -> Sequence[_DelayEvent]: ...
    @property
    def jumps(self) -> Sequence[_DelayJump]: ...
    @property
    def history_breaks(self) -> _Reals: ...
    @property
    def args(self) -> tuple[Any, ...]: ...
    @property
    def vectorized(self) -> bool: ...
    @property
    def max_step(self) -> float: ...
    @property
    def max_steps(self) -> int | None: ...
    @property
    def jac_sparsity(self) -> tuple[list[int], list[int]] | None: ...

@final
class DelayRun:
    t: Final[_Reals]
    y: Final[_Reals]
    t_events: Final[list[_Reals]]
    y_events: Final[list[_Reals]]
    breaks: Final[_Reals]
    nfev: Final[int]
    n_nodes: Final[int]
    n_elements: Final[int]
    n_rejected: Final[int]
    outcome: Final[str]
    end: Final[float]
    pieces: Final[DelayPieces]

def solve_dde(problem: _DelayProblem) -> DelayRun: ...

# --- wire formats ---------------------------------------------------------------------

@final
class AtCommand:
    sequence: Final[int]
    name: Final[str]
    arguments: Final[tuple[Any, ...]]

def at_write(commands: Sequence[tuple[str, tuple[Any, ...]]], first: int) -> bytes: ...
def at_read(datagram: bytes) -> list[AtCommand]: ...

@final
class NavdataOption:
    tag: Final[int]
    body: Final[bytes]
    values: Final[tuple[float, ...] | None]

@final
class Navdata:
    header: Final[int]
    state: Final[int]
    sequence: Final[int]
    vision: Final[int]
    options: Final[list[NavdataOption]]
    checksum_matches: Final[bool]

@final
class NavdataLayout:
    tag: Final[int]
    length: Final[int]
    name: Final[str]
    doc: Final[str]
    fields: Final[list[tuple[str, str, float]]]

def navdata_read(packet: bytes, verify: bool) -> Navdata: ...
def navdata_write(
    options: Sequence[tuple[int, bytes, tuple[float, ...] | None]],
    *,
    header: int,
    state: int,
    sequence: int,
    vision: int,
) -> bytes: ...
def navdata_layouts() -> list[NavdataLayout]: ...
def navdata_full() -> list[tuple[int, int]]: ...
def configuration_read(dump: bytes) -> list[tuple[str, str]]: ...
def configuration_write(settings: Sequence[tuple[str, str]]) -> bytes: ...

@final
class LoopPacket:
    sequence: Final[int]
    sent: Final[float]
    echo_sequence: Final[int]
    echo_sent: Final[float]
    held: Final[float]
    value: Final[float]
    reference: Final[float]
    flags: Final[int]

def loop_packet_read(packet: bytes) -> LoopPacket: ...
def loop_packet_write(
    *,
    sequence: int,
    sent: float,
    echo_sequence: int,
    echo_sent: float,
    held: float,
    value: float,
    reference: float,
    flags: int,
) -> bytes: ...

@final
class BlackboxFrames:
    main: Final[NDArray[np.int32]]
    slow: Final[NDArray[np.int32]]
    slow_before: Final[NDArray[np.uint32]]
    gps: Final[NDArray[np.int32]]
    gps_before: Final[NDArray[np.uint32]]
    ended: Final[bool]
    damaged: Final[int]
    unusable: Final[int]

class _BlackboxLayout(Protocol):
    @property
    def intra(self) -> tuple[bytes, bytes]: ...
    @property
    def inter(self) -> tuple[bytes, bytes] | None: ...
    @property
    def slow(self) -> tuple[bytes, bytes] | None: ...
    @property
    def gps(self) -> tuple[bytes, bytes] | None: ...
    @property
    def home(self) -> tuple[bytes, bytes] | None: ...
    @property
    def iteration(self) -> int: ...
    @property
    def time(self) -> int: ...
    @property
    def first_motor(self) -> int | None: ...
    @property
    def least_throttle(self) -> int: ...
    @property
    def least_motor(self) -> int: ...
    @property
    def voltage(self) -> int: ...
    @property
    def interval(self) -> int: ...
    @property
    def logged(self) -> tuple[int, int]: ...

def blackbox_frames(log: bytes, layout: _BlackboxLayout, limit: int) -> BlackboxFrames: ...

@final
class CsvColumns:
    values: Final[list[NDArray[np.float64]]]
    backward: Final[tuple[int, float, float] | None]
    repeated: Final[tuple[int, float, float] | None]

class _CsvLayout(Protocol):
    @property
    def start(self) -> int: ...
    @property
    def delimiter(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def columns(self) -> list[tuple[int, str]]: ...
    @property
    def window(self) -> tuple[float, float]: ...
    @property
    def line(self) -> int: ...

def csv_columns(table: bytes, layout: _CsvLayout) -> CsvColumns: ...
def doubles_read(packet: bytes, count: int) -> list[float]: ...
def doubles_write(values: Sequence[float]) -> bytes: ...
