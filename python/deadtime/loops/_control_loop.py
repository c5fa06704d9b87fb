"""A feedback loop with a delay: plant, controller, delay, and the hold and limit around them.

One class, kept whole: most of the file is its documentation.
"""

from __future__ import annotations

import operator
from collections.abc import Collection, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.validation import finite, non_negative, positive, real_array
from deadtime.loops._controllers import Controller
from deadtime.loops._family import family_of_loop
from deadtime.loops._model import LoopModel, state_at_rest
from deadtime.loops._plants import Plant
from deadtime.loops._run import settled_step, simulate_loop
from deadtime.loops._sampled_gain import SampledLoopGain
from deadtime.loops._sampled_margins import sampled_margins
from deadtime.loops._sampled_ranges import SampledNumber, further_delay
from deadtime.loops._stability import (
    characteristic,
    closed_loop,
    continuous_range,
    open_loop,
    sampled_abscissa,
    sampled_is_stable,
    sampled_range,
    sampled_roots,
)
from deadtime.roots import ParametricQuasiPolynomial, QuasiPolynomial, RootSet
from deadtime.systems import Margins, Response, TransferFunction

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from deadtime._deadtime import LinearLoop

__all__ = ["ControlLoop"]

_FIELDS = ("plant", "controller", "delay", "sample_time", "limit", "delay_path")
_PATHS = ("command", "measurement")


@dataclass(frozen=True)
class ControlLoop:
    """A plant under feedback with one delay in the loop.

    The command u of the controller is limited, delayed by `delay` and reaches the plant as w.
    With `sample_time` the controller computes u only every `sample_time` seconds and holds it;
    such a loop is not a continuous one, and everything here treats it exactly.

    Parameters
    ----------
    plant : Plant
        `Integrator`, `FirstOrder` or `RationalPlant`.
    controller : Controller
        `P`, `PV`, `PD`, `PI` or `PID`.
    delay : float, optional
        Delay in s, zero or more; None where it is not known yet.
    sample_time : float, optional
        Sample time in s; None for continuous time.
    limit : float, optional
        Bound of the command, abs(u) <= limit; None for no bound.
    delay_path : {"command", "measurement"}
        Where the delay sits. Between command and plant, the output starts to move `delay` after a
        step; in the measurement, the output itself is the same function `delay` earlier.

    Raises
    ------
    ValueError
        If a number is negative, not finite or zero where it must not be; the message names it.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.4), delay=0.36, sample_time=0.065)
    >>> loop.is_stable()
    True
    >>> info = loop.step_response().info()
    >>> round(info["overshoot"], 1), round(info["settling_time"], 2)
    (44.0, 4.31)
    """

    plant: Plant
    controller: Controller
    _: KW_ONLY
    delay: float | None = None
    sample_time: float | None = None
    limit: float | None = None
    delay_path: Literal["command", "measurement"] = "command"

    def __post_init__(self) -> None:
        if not isinstance(self.plant, Plant):
            raise TypeError(f"plant={self.plant!r}: give a plant, for example Integrator()")
        if not isinstance(self.controller, Controller):
            raise TypeError(f"controller={self.controller!r}: give a controller, such as P(Kp=1)")
        if self.delay is not None:
            object.__setattr__(self, "delay", non_negative("delay", self.delay))
        if self.sample_time is not None:
            object.__setattr__(self, "sample_time", positive("sample_time", self.sample_time))
        if self.limit is not None:
            object.__setattr__(self, "limit", positive("limit", self.limit))
        if self.delay_path not in _PATHS:
            raise ValueError(
                f"delay_path={self.delay_path!r}: give one of {', '.join(map(repr, _PATHS))}"
            )
        # Building the model checks that its parts fit; it is kept.
        object.__setattr__(self, "_model", self._model)

    def __getstate__(self) -> dict[str, Any]:
        # Without what is kept for speed: the native loop does not pickle and is soon made again.
        return {name: getattr(self, name) for name in _FIELDS}

    @property
    def is_sampled(self) -> bool:
        """Whether the command is held between samples."""
        return self.sample_time is not None

    @property
    def parameters(self) -> dict[str, float]:
        """The named numbers of the loop: those of plant and controller, then its own.

        Returns
        -------
        dict of str to float
            ``delay``, ``sample_time`` and ``limit`` are there where they are not None.
        """
        own = {name: getattr(self, name) for name in ("delay", "sample_time", "limit")}
        known = {name: value for name, value in own.items() if value is not None}
        return self.plant.parameters | self.controller.parameters | known

    def replace(self, **changes: Any) -> ControlLoop:
        """Return the loop with other numbers or other parts.

        Parameters
        ----------
        **changes
            Names of `parameters`, or the arguments of `ControlLoop`.

        Returns
        -------
        ControlLoop

        Raises
        ------
        ValueError
            If the loop has no such name.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.4))
        >>> loop.replace(delay=0.36, Kp=3.0).parameters
        {'gain': 1.0, 'lag': 0.0, 'Kp': 3.0, 'delay': 0.36}
        """
        parts = {name: changes.pop(name, getattr(self, name)) for name in _FIELDS}
        for part in ("plant", "controller"):
            if isinstance(parts[part], (Plant, Controller)):
                mine = parts[part].parameters
                numbers = {name: changes.pop(name) for name in mine if name in changes}
                if numbers:
                    parts[part] = parts[part]._replace(numbers)
        if changes:
            raise ValueError(
                f"{', '.join(changes)}: no such number in this loop, which has "
                f"{', '.join(self.parameters)}"
            )
        return ControlLoop(**parts)

    def continuous(self) -> ControlLoop:
        """Return the same loop without the hold, as if the controller computed all the time."""
        return self.replace(sample_time=None)

    def simulate(
        self,
        time: ArrayLike,
        reference: ArrayLike = 1.0,
        *,
        initial_output: float = 0.0,
        reference_before: float | None = None,
        reference_time: ArrayLike | None = None,
        command_history: ArrayLike = (),
        sample_phase: float = 0.0,
        sensitivities: Sequence[str] = (),
    ) -> Response:
        """Response to a reference that is constant between jumps, exact to rounding.

        The run starts at ``time[0]`` with the plant at rest at `initial_output`, under the command
        that keeps it there.

        Parameters
        ----------
        time : array_like, shape (n,)
            Output times in s, increasing.
        reference : float or array_like, shape (m,)
            A number: a step to it at the start. An array: values that hold from the times in
            `reference_time` on.
        initial_output : float
            Output at the start.
        reference_before : float, optional
            Reference before the first jump; `initial_output` by default.
        reference_time : array_like, shape (m,), optional
            Times of the values of an array `reference`, increasing, in the same clock as `time`;
            `time` itself where the lengths agree.
        command_history : array_like, optional
            Sampled loops: the commands issued at the samples before the start, the latest last.
            Those still under way arrive as they did; before them the plant was at rest.
        sample_phase : float
            Sampled loops: time in s from the start to the first sample, in [0, sample_time).
        sensitivities : sequence of str, optional
            Names of `parameters` with respect to which the response is differentiated: see
            `Response.sensitivities`.

        Returns
        -------
        Response

        Raises
        ------
        ValueError
            If the delay is None, an argument is out of its range, or the response grows beyond
            1e150; the message says when.

        Notes
        -----
        Continuous loops are integrated by the method of steps in Taylor elements that end at
        every breaking point, sampled ones by matrix exponentials between events; see the
        description of the delay differential equations in the manual. A sampled controller reads
        output and reference at the sample; one that lies on a jump reads the reference after it.

        Sensitivities are exact as well: the same engines run in numbers that carry a slope, and
        jumps, samples and switching times move with the parameter. At a time at which the
        response jumps, the derivative is that of what follows the jump; where the delay is a
        whole number of samples, that for a longer delay.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.31), delay=0.36, limit=1.0)
        >>> response = loop.simulate([0.0, 1.0, 2.0, 10.0], reference=2.0)
        >>> print(response.outputs)
        [0.         0.64       1.63876861 2.        ]

        How the output answers to the delay and to the gain:

        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.31), delay=0.36)
        >>> response = loop.simulate([0.0, 0.5, 1.0], sensitivities=("delay", "Kp"))
        >>> print(response.sensitivities["delay"])       # before 2 delays: y = Kp (t - delay)
        [ 0.         -1.31       -0.348984]
        """
        return simulate_loop(
            self,
            time,
            reference,
            initial_output=initial_output,
            reference_before=reference_before,
            reference_time=reference_time,
            command_history=command_history,
            sample_phase=sample_phase,
            sensitivities=sensitivities,
        )

    def step_response(self, time: ArrayLike | None = None, amplitude: float = 1.0) -> Response:
        """Response to a step of the reference from rest at zero.

        Parameters
        ----------
        time : array_like, optional
            Output times in s; by default 501 from the step until the response has settled, or
            has visibly failed to.
        amplitude : float
            Height of the step.

        Returns
        -------
        Response

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.0), delay=0.36)
        >>> round(loop.step_response().info()["overshoot"], 3)
        22.475
        """
        if time is not None:
            return self.simulate(time, amplitude)
        return settled_step(self, finite("amplitude", amplitude))

    def characteristic(self) -> QuasiPolynomial:
        """Return the characteristic function of the continuous loop, its limit left out.

        Returns
        -------
        QuasiPolynomial
            a g + b f exp(-s delay) for the plant b/a and the feedback f/g.

        Raises
        ------
        ValueError
            If the loop is sampled or its delay is None.

        Examples
        --------
        >>> import deadtime as dtm
        >>> h = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36).characteristic()
        >>> h.kind
        'neutral'
        """
        self._refuse_hold(
            "has finitely many poles and no characteristic quasi-polynomial: use "
            "transition_matrix() or rightmost(), or continuous().characteristic() for the loop "
            "without its hold"
        )
        self._known_delay()
        return cast("QuasiPolynomial", self._characteristic(self.parameters))

    def _characteristic(self, values: Mapping[str, Any]) -> Any:
        """Characteristic function with numbers or symbols from `values`, which name them all."""
        return characteristic(self.plant, self.controller, values)

    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial:
        """Characteristic function with the numbers `names` as its parameters."""
        if self.is_sampled:
            raise ValueError(
                f"a loop with sample_time={self.sample_time} has no characteristic function to "
                "prove anything of, its poles are eigenvalues: judge loop.continuous() for the "
                "loop without its hold, or look at single cells with dtm.stability_map"
            )
        return family_of_loop(self._characteristic, self.parameters, names)

    def _delay_margin(self) -> float:
        """Further delay that the stable loop bears, s."""
        if self.is_sampled:
            return self.stable_range("delay")[1] - self._known_delay()
        return self.margin()._delay_margin()

    def open_loop(self) -> TransferFunction:
        """Return the loop gain of the continuous loop, cut at the command, its limit left out.

        Returns
        -------
        TransferFunction
            b f exp(-s delay) / (a g) for the plant b/a and the feedback f/g; ``feedback`` of it
            has `characteristic` as its denominator.

        Raises
        ------
        ValueError
            If the loop is sampled or its delay is None.

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36).open_loop()
        (2 + 0.3 s) exp(-0.36 s) / s
        """
        self._refuse_hold(
            "has a hold in it, which this transfer function would leave out: use "
            "continuous().open_loop() to leave it out on purpose"
        )
        self._known_delay()
        return open_loop(self.plant, self.controller, self.parameters)

    def closed_loop(self) -> TransferFunction:
        """Return the transfer function from reference to output, the limit left out.

        Returns
        -------
        TransferFunction
            With the delay in the numerator where `delay_path` is "command".

        Raises
        ------
        ValueError
            If the loop is sampled or its delay is None.

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36).closed_loop()
        2 exp(-0.36 s) / (s + (2 + 0.3 s) exp(-0.36 s))
        """
        self._refuse_hold(
            "has a hold in it, which this transfer function would leave out: use "
            "continuous().closed_loop() to leave it out on purpose"
        )
        self._known_delay()
        late = self.delay_path == "command"
        return closed_loop(self.plant, self.controller, self.parameters, late)

    def margin(self) -> Margins:
        """Return the gain, phase and delay margin of the loop, its limit left out.

        Returns
        -------
        Margins
            Of a sampled loop: hold and delay taken exactly. Its `delay_margins` are empty, because
            further delay changes the hold's share and with it every crossing; `delay_margin` is
            what `stable_range` finds.

        Raises
        ------
        ValueError
            If the delay is None, or the gain grows with frequency.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36)
        >>> loop.margin()
        <Margins: gain 2.182 at 4.363 rad/s, phase 48.75° at 2 rad/s, delay 0.4254 s at 2 rad/s>
        >>> round(loop.stable_range("delay")[1] - loop.delay, 4)
        0.4254

        The hold costs a part of each:

        >>> loop.replace(sample_time=0.065).margin()
        <Margins: gain 2.012 at 4.002 rad/s, phase 45.09° at 1.997 rad/s, delay 0.3939 s at ...>
        """
        if self.is_sampled:
            stable = self.spectral_abscissa() < 0.0
            return sampled_margins(self._sampled_gain, stable, self._further_delay)
        return self.open_loop().margin()

    def frequency_response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Return the loop gain, cut at the command, at frequencies; its limit left out.

        Parameters
        ----------
        omega : array_like
            Frequencies in rad/s; of a sampled loop from 0 to pi/sample_time.

        Returns
        -------
        ndarray of complex, shape of `omega`
            Of a continuous loop ``open_loop().frequency_response(omega)``. Of a sampled one
            L(z) at z = exp(j omega sample_time), hold and delay taken exactly: minus the command
            that comes back for one that goes out.

        Raises
        ------
        ValueError
            If the delay is None, or a frequency is out of range.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
        >>> print(loop.frequency_response([1.0, 2.0]).round(4), loop.phase(2.0).round(4))
        [-0.7647-1.8473j -0.7058-0.7064j] -2.3558
        """
        if self.is_sampled:
            return self._sampled_gain.frequency_response(omega)
        return self.open_loop().frequency_response(omega)

    def phase(self, omega: ArrayLike) -> NDArray[np.float64]:
        """Return the argument of `frequency_response` in rad, continuous from zero frequency on.

        Parameters
        ----------
        omega : array_like
            Frequencies in rad/s.

        Returns
        -------
        ndarray of float, shape of `omega`

        Raises
        ------
        ValueError
            As in `frequency_response`.
        """
        if self.is_sampled:
            return self._sampled_gain.phase(omega)
        return self.open_loop().phase(omega)

    def bode(
        self, omega: ArrayLike | None = None, *, axes: Sequence[Axes] | None = None
    ) -> Sequence[Axes]:
        """Draw gain and phase of the loop gain over frequency, and mark the margins.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies in rad/s, above zero and increasing; by default from two decades below
            the gain crossover to where the delay has turned the phase a few times, of a sampled
            loop to pi/sample_time.
        axes : sequence of two matplotlib.axes.Axes, optional
            Where to draw gain and phase; a new figure by default.

        Returns
        -------
        sequence of two matplotlib.axes.Axes

        Raises
        ------
        ValueError
            As in `frequency_response` and `margin`.
        """
        from deadtime._base.drawing import shown_rows
        from deadtime.systems._plots import plot_bode

        found = self.margin()
        if omega is None:
            marks = [*found.gain_crossovers, 1.0 / max(self._known_delay(), 1e-9)]
            low, high = 0.01 * min(marks), 20.0 * max(marks)
            if self.sample_time is not None:
                high = np.pi / self.sample_time
                low = min(low, 0.01 * high)
            omega = np.geomspace(low, high, 1001)
        drawn = shown_rows(axes, 2)
        plot_bode(drawn, self, real_array("omega", omega), found)
        return drawn

    def transition_matrix(self) -> NDArray[np.float64]:
        """Return the matrix that takes a sampled loop, limit left out, from sample to sample.

        Returns
        -------
        ndarray, shape (n + m + 1, n + m + 1)
            For the state (x, u_{k-1}, ..., u_{k-m-1}): the n states of plant and controller, and
            as many past commands as reach into the present sample interval, m = floor(delay /
            sample_time).

        Raises
        ------
        ValueError
            If the loop is continuous, its delay is None or holds too many samples.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.1, sample_time=0.1)
        >>> loop.transition_matrix()
        array([[ 1. ,  0.1,  0. ],
               [-2. ,  0. ,  0. ],
               [ 0. ,  1. ,  0. ]])
        """
        if not self.is_sampled:
            raise ValueError(
                "a continuous loop has no transition matrix: use characteristic(), or give the "
                "loop a sample_time"
            )
        return self._native.transition_matrix()

    def rightmost(self, n: int = 1) -> RootSet:
        """Return the `n` rightmost poles, limit left out.

        Parameters
        ----------
        n : int
            How many, not counting mirror images in the real axis, which are listed as well.

        Returns
        -------
        RootSet
            Of a continuous loop: roots of `characteristic`, with proved discs. Of a sampled loop:
            s = ln(z)/sample_time for the eigenvalues z of `transition_matrix`; the radii are no
            proof but bound the rounding error to first order, and a pole is ``resolved`` where
            its disc keeps clear of the others.

        Raises
        ------
        ValueError
            If the delay is None or `n` is less than one.
        """
        number = operator.index(n)
        if number < 1:
            raise ValueError(f"n={n}: ask for one pole at least")
        if self.sample_time is None:
            return self.characteristic().rightmost(number)
        return sampled_roots(self._native.balanced_matrix(), self.sample_time, number)

    def spectral_abscissa(self) -> float:
        """Return the largest real part of the poles in 1/s, limit left out.

        Small deviations from rest grow or decay like exp(abscissa t).

        Returns
        -------
        float
            ln(rho)/sample_time for a sampled loop, rho the spectral radius of its transition
            matrix.

        Raises
        ------
        ValueError
            If the delay is None.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
        >>> round(loop.spectral_abscissa(), 6), round(loop.continuous().spectral_abscissa(), 6)
        (-1.238057, -1.515362)
        """
        return self._abscissa(self.parameters)

    def is_stable(self) -> bool:
        """Whether every pole lies left of the imaginary axis, limit left out.

        For a neutral loop it must stay so under small changes of the delay (strong stability).

        Returns
        -------
        bool

        Raises
        ------
        ValueError
            If the delay is None; if a pole of a sampled loop is as near to the unit circle as
            rounding.
        """
        if self.sample_time is not None:
            return sampled_is_stable(self._model, self._known_delay(), self.sample_time)
        return bool(self.characteristic().is_stable())

    def stable_range(self, name: str) -> tuple[float, float]:
        """Interval of one named number, around its present value, on which the loop is stable.

        The ends are the nearest values on either side at which a pole comes to the edge of
        stability, or a neutral loop loses strong stability. None is passed over, however soon
        stability is regained: of a continuous loop they are among all its `crossings`; of a
        sampled one, steps are taken for which the loop gain on the unit circle keeps clear of -1.

        Parameters
        ----------
        name : str
            One of `parameters`, but not ``limit``.

        Returns
        -------
        (low, high) : tuple of float
            An end is infinite only where nothing beyond can make the loop unstable, and 0 for a
            number that cannot be negative where stability is not lost on the way down; a number
            without a meaning at zero is followed down to a millionth of its value.

        Raises
        ------
        ValueError
            If the loop is unstable as it is, its delay is None or it has no such number; if an end
            is neither found nor ruled out: the message says up to where the loop is stable.

        Notes
        -----
        Of a sampled loop the frequencies at which the loop gain is looked at are dense, but chosen
        by its poles, zeros and peaks and not by a proof. Of a neutral loop the last hundredth of
        the way to where it loses strong stability is halved, not searched for all crossings.

        Examples
        --------
        The hold costs stability:

        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
        >>> low, high = loop.stable_range("Kp")
        >>> round(high, 3), round(loop.continuous().stable_range("Kp")[1], 3)
        (4.024, 4.363)
        """
        values = self.parameters
        if name not in values or name == "limit":
            raise ValueError(
                f"{name!r} is not a number whose range can be sought: choose one of "
                f"{', '.join(known for known in values if known != 'limit')}"
            )
        if not self.is_stable():
            raise ValueError(
                f"the loop is not stable at {name}={values[name]}: start from a stable one, for "
                "example with lower gains"
            )
        seek = sampled_range if self.is_sampled else continuous_range
        return seek(self.plant, self.controller, values, name)

    def _abscissa(self, values: Mapping[str, float]) -> float:
        """Spectral abscissa with numbers from `values`, which may lie outside the usual range."""
        self._known_delay()
        if self.is_sampled:
            model = LoopModel.build(self.plant, self.controller, values)
            return sampled_abscissa(model, values["delay"], values["sample_time"])
        return float(self._characteristic(values).spectral_abscissa())

    @cached_property
    def _model(self) -> LoopModel:
        return LoopModel.build(self.plant, self.controller, self.parameters)

    @cached_property
    def _sampled_gain(self) -> SampledLoopGain:
        period = cast(float, self.sample_time)
        return SampledLoopGain.of(self._model, self._known_delay(), period)

    def _further_delay(self) -> tuple[float, float]:
        """How much more delay a stable sampled loop bears, and the frequency it then swings at."""
        numbers = self.parameters
        build = partial(LoopModel.build, self.plant, self.controller)
        return further_delay(SampledNumber(build, numbers, "delay"))

    @cached_property
    def _native(self) -> LinearLoop:
        return self._model.native(self._known_delay(), self.sample_time, self.limit)

    @cached_property
    def _runner(self) -> tuple[LinearLoop, float]:
        """What simulates the loop, and how much later than its clock the output is read."""
        ahead = self._known_delay() if self.delay_path == "measurement" else 0.0
        return self._native, ahead

    @cached_property
    def _rest_at_zero(self) -> tuple[NDArray[np.float64], float]:
        return self._at_rest_with(0.0, 0.0)

    def _at_rest(self, output: float, reference: float) -> tuple[NDArray[np.float64], float]:
        """State in which the plant rests at `output`, and the command that keeps it there."""
        if output == 0.0 and reference == 0.0:
            return self._rest_at_zero
        return self._at_rest_with(output, reference)

    def _at_rest_with(self, output: float, reference: float) -> tuple[NDArray[np.float64], float]:
        plant = self._model.plant
        return state_at_rest(self.plant, self.controller, self.parameters, output, reference, plant)

    def _refuse_hold(self, why: str) -> None:
        if self.is_sampled:
            raise ValueError(f"a loop with sample_time={self.sample_time} {why}")

    def _known_delay(self) -> float:
        if self.delay is None:
            raise ValueError(
                "the delay of this loop is None: set it with loop.replace(delay=...) or estimate "
                "it from a recording first"
            )
        return self.delay
