"""The loop gain of a control loop: margins, frequency response and transfer functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.drawing import Axes, shown_rows
from deadtime._base.validation import real_array
from deadtime.loops._specification import LoopSpecification
from deadtime.systems import Margins, TransferFunction, margins, margins_of

#: Transfer functions of a closed loop.
_TRANSFERS: TypeAlias = Literal["sensitivity", "complementary", "output", "command"]


class LoopGain:
    """The loop gain of a `ControlLoop`, which is cut at the command."""

    specification: LoopSpecification

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
        return self._without_hold("open_loop").transfer("open")

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
        return self._without_hold("closed_loop").transfer("output")

    def _without_hold(self, question: str) -> LoopSpecification:
        """The continuous loop, for a question that would leave a hold out."""
        self.specification.refuse_hold(
            "has a hold, which this transfer function would ignore. To ignore the hold on "
            f"purpose, use continuous().{question}()"
        )
        return self.specification

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
        return self._margin()

    def _margin(self, delay_margin: bool = True) -> Margins:
        """The margins; without the delay margin, which is NaN, where a sampled loop may save it."""
        loop = self.specification
        if loop.sample_time is None:
            gain = self.open_loop()
            return margins(gain.num, gain.den, all_modes=True)
        _ = loop.known_delay
        return margins_of(loop.native.held_margins(delay_margin))

    def hinf_norm(self, of: _TRANSFERS = "sensitivity") -> float:
        """Return the largest gain over frequency of a transfer function of the closed loop.

        Parameters
        ----------
        of : {"sensitivity", "complementary", "output", "command"}
            S = 1/(1 + L), T = L/(1 + L), or from the reference to the output or the command; the
            limit left out.

        Returns
        -------
        float
            As of `TransferFunction.hinf_norm`, infinite of a loop that is not stable. Of a sampled
            loop that of S or T from sample to sample, on the unit circle.

        Raises
        ------
        ValueError
            If the delay is None; of a sampled loop for "output" or "command", which are no
            functions of one frequency.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
        >>> round(loop.hinf_norm(), 4), loop.hinf_norm("output")
        (1.3831, 1.0)
        """
        chosen = get_args(_TRANSFERS)
        if of not in chosen:
            raise ValueError(f"of={of!r}: give one of {', '.join(map(repr, chosen))}")
        if of in ("output", "command"):
            if self.specification.sample_time is not None:
                raise ValueError(
                    f"of={of!r}: between samples, a sampled loop responds to one frequency with "
                    "many frequencies. Give 'sensitivity' or 'complementary', or use the "
                    "continuous() loop"
                )
            return self.specification.transfer(of).hinf_norm()
        found = self._margin(delay_margin=False)
        if not found.stable:
            return np.inf
        if of == "sensitivity":
            return found.max_sensitivity
        return found.max_complementary_sensitivity

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
        if self.specification.sample_time is not None:
            given = real_array("omega", omega)
            return self.specification.native.held_gain(given).reshape(given.shape)
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
        if self.specification.sample_time is not None:
            given = real_array("omega", omega)
            return self.specification.native.held_phase(given).reshape(given.shape)
        return self.open_loop().phase(omega)

    def bode(
        self, omega: ArrayLike | None = None, *, ax: Sequence[Axes] | None = None
    ) -> Sequence[Axes]:
        """Draw gain and phase of the loop gain over frequency, and mark the margins.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies in rad/s, above zero and increasing; by default from two decades below
            the gain crossover to where the delay has turned the phase a few times, of a sampled
            loop to pi/sample_time.
        ax : sequence of two matplotlib.axes.Axes, optional
            Where to draw gain and phase; a new figure by default.

        Returns
        -------
        sequence of two matplotlib.axes.Axes

        Raises
        ------
        ValueError
            As in `frequency_response` and `margin`.
        """
        from deadtime.systems import plot_bode

        loop, found = self.specification, self.margin()
        if omega is None:
            marks = [*found.gain_crossovers, 1.0 / max(loop.known_delay, 1e-9)]
            low, high = 0.01 * min(marks), 20.0 * max(marks)
            if loop.sample_time is not None:
                high = np.pi / loop.sample_time
                low = min(low, 0.01 * high)
            omega = np.geomspace(low, high, 1001)
        drawn = shown_rows(ax, 2)
        plot_bode(drawn, self, real_array("omega", omega), found)
        return drawn

    def _delay_margin(self) -> float:
        """Delay margin of a loop that must be stable, s."""
        loop = self.specification
        if loop.sample_time is None:
            return self.margin()._delay_margin()
        if not loop.native.is_stable():
            raise ValueError(
                "the loop is not stable even without further delay, so it has no delay margin"
            )
        return loop.native.further_delay()[0]
