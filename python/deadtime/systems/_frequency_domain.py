"""A transfer function over frequency: gain, phase, margins, and their pictures."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deadtime._base.drawing import Axes, shown_axes, shown_rows
from deadtime._base.validation import real_array
from deadtime.roots import QuasiPolynomial
from deadtime.systems._margins import Margins, margins
from deadtime.systems._native import hinf_norm


class FrequencyDomain(ABC):
    """Base of `TransferFunction`: what is asked on the imaginary axis."""

    __slots__ = ()

    _num: QuasiPolynomial
    _den: QuasiPolynomial

    @abstractmethod
    def __call__(self, s: Any) -> Any: ...

    def frequency_response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Value on the imaginary axis, G(j omega).

        Parameters
        ----------
        omega : array_like
            Frequencies in rad/s.

        Returns
        -------
        ndarray of complex, shape of `omega`

        Examples
        --------
        >>> from deadtime import delay, s
        >>> print((2.0 / (s + 1) * delay(0.5)).frequency_response([0.0, 1.0]).round(4))
        [2.    +0.j     0.3982-1.357j]
        """
        frequencies = _frequencies(omega)
        return np.asarray(self(1j * frequencies))

    def phase(self, omega: ArrayLike) -> NDArray[np.float64]:
        """Argument of G(j omega), continuous from zero frequency on.

        A single delay of the numerator or denominator enters exactly, and intervals between the
        frequencies asked for are halved until no turn can go unseen, so the phase is right also
        where it turns many times from one of them to the next. Where one term outweighs all
        others the intervals grow with the frequency, up to the largest one that a double holds.

        Parameters
        ----------
        omega : array_like
            Frequencies in rad/s; at zero the limit from above.

        Returns
        -------
        ndarray of float, shape of `omega`
            In rad. It starts from a quarter turn down for each pole at zero, up for each zero
            there, with half a turn up where the rest of the numerator is negative, down where
            that of the denominator is. At a pole on the axis it falls by half a turn, at a zero
            it rises.

        Raises
        ------
        ValueError
            Where it cannot be followed so far: no term of a neutral function outweighs the
            others, or the product of delay and frequency is beyond 1e308.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> print((2.0 / s * delay(0.36)).phase([1.0, 100.0]))
        [ -1.93079633 -37.57079633]
        """
        frequencies = _frequencies(omega)
        if not self._num.coefficients.any():
            raise ValueError("this transfer function is zero, so it has no phase")
        size = np.abs(frequencies).ravel()
        (a, p), (b, q) = self._num._native.first_term(), self._den._native.first_term()
        start = np.pi * (int(a < 0.0) - int(b < 0.0) + 0.5 * (p - q))
        phase = np.full(size.shape, start)
        above = size > 0.0
        phase[above] = self._num._native.argument(size[above])
        phase[above] -= self._den._native.argument(size[above])
        mirrored = np.where(frequencies.ravel() < 0.0, -phase, phase)
        return np.asarray(mirrored.reshape(frequencies.shape))

    def dcgain(self) -> float:
        """Limit at zero frequency, as s comes to zero from the right.

        Returns
        -------
        float
            Infinite at a pole, with its sign.

        Examples
        --------
        >>> import deadtime as dtm
        >>> (2.0 / (dtm.s + 4.0)).dcgain(), ((1 - dtm.delay(0.5)) / dtm.s).dcgain()
        (0.5, 0.5)
        """
        if not self._num.coefficients.any():
            return 0.0
        (a, p), (b, q) = self._num._native.first_term(), self._den._native.first_term()
        if p > q:
            return 0.0
        return a / b if p == q else math.copysign(math.inf, a * b)

    def _delay_margin(self) -> float:
        return self.margin()._delay_margin()

    def margin(self) -> Margins:
        """Gain, phase and delay margin of the loop closed around this one by ``feedback(G)``.

        Returns
        -------
        Margins
            With every frequency at which the gain is one, or the phase 180 degrees, behind it.

        Raises
        ------
        ValueError
            If the gain grows with frequency, the loop gain is not causal, or its gain is one (its
            phase 180 degrees) on a whole range of frequencies.

        Notes
        -----
        All crossings are found, by a bound on the curvature of abs(num)^2 - abs(den)^2 and of
        Im(num conj(den)) between the points at which they are evaluated, and a bound on the
        frequencies that matter. Stability of the closed loop, as it is, is that of ``feedback(G)``,
        decided by a proved count of roots.

        Examples
        --------
        >>> from deadtime import delay, s
        >>> (1.5 * (s + 1) / (s * (s**2 + 0.5 * s + 9)) * delay(0.05)).margin()
        <Margins: gain 2.616 at 3.559 rad/s, phase 49.19° at 3.063 rad/s, delay 0.2803 s at ...>
        >>> (9.0 / s * delay(0.36)).margin()
        <Margins: none, the closed loop is not stable as it is>
        """
        return margins(self._num, self._den, all_modes=False)

    def hinf_norm(self) -> float:
        """Largest gain over all frequencies, sup abs(G(j omega)).

        Returns
        -------
        float
            To 5e-11 of itself. Infinite where G is not stable or grows with frequency; modes that
            numerator and denominator have in common do not count. Of a neutral system the strong
            norm, which takes any phase for each delay at high frequencies: small changes of the
            delays do not change it (Gumussoy and Michiels 2011, section 3).

        Raises
        ------
        ValueError
            If several delays are in the highest power of s of both numerator and denominator, so
            that the gain at high frequencies has no known bound.

        Notes
        -----
        At a level just above the largest gain known, all frequencies that reach it are found, as
        in `margin`, so that there is proof that none does (Boyd and Balakrishnan 1990).

        Examples
        --------
        >>> from deadtime import delay, s
        >>> round((1.0 / (s**2 + 0.2 * s + 1) * delay(0.3)).hinf_norm(), 6)
        5.025189
        >>> (1.0 / (s - 1.0)).hinf_norm()
        inf
        """
        return hinf_norm(self._num._native, self._den._native)[0]

    def bode(
        self,
        omega: ArrayLike | None = None,
        *,
        margins: bool = False,
        ax: Sequence[Axes] | None = None,
    ) -> Sequence[Axes]:
        """Draw gain and phase over frequency.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies in rad/s, above zero and increasing; by default from a decade below the
            lowest corner to a decade above the highest.
        margins : bool, default False
            Take this as a loop gain and mark its margins.
        ax : sequence of two matplotlib.axes.Axes, optional
            Where to draw gain and phase; a new figure by default.

        Returns
        -------
        sequence of two matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If the frequencies are no increasing ones above zero; with `margins` as in `margin`.
        """
        from deadtime.systems._plots import plot_bode

        places = self._plotted(omega, 0.1, 10.0)
        found = self.margin() if margins else None
        drawn = shown_rows(ax, 2)
        plot_bode(drawn, self, places, found)
        return drawn

    def nyquist(
        self,
        omega: ArrayLike | None = None,
        *,
        margins: bool = False,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw the frequency response in the complex plane, with the critical point -1.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies in rad/s, above zero and increasing; by default far enough both ways for
            the curve to end. The mirror image for negative ones is drawn dashed.
        margins : bool, default False
            Take this as a loop gain and mark its margins.
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            As in `bode`.
        """
        from deadtime.systems._plots import plot_nyquist

        places = self._plotted(omega, 1e-3, 100.0)
        found = self.margin() if margins else None
        ax = shown_axes(ax)
        plot_nyquist(ax, cast(Any, self), places, found)
        return ax

    def _plotted(self, omega: ArrayLike | None, below: float, beyond: float) -> NDArray[np.float64]:
        """Frequencies to draw at: those given, checked, or these factors from the corners."""
        if omega is not None:
            given = _frequencies(omega)
            rising = given.ndim == 1 and given.size > 1 and bool(np.all(np.diff(given) > 0.0))
            if not rising or given[0] <= 0.0:
                raise ValueError(
                    "omega: give two or more frequencies in rad/s, all above zero and increasing"
                )
            return given
        corners: list[float] = []
        for h in (self._num, self._den):
            for row, tau in zip(h.coefficients, h.delays, strict=True):
                roots = np.abs(np.roots(row[::-1]))
                corners += roots[roots > 0.0].tolist()
                if tau > 0.0:
                    corners.append(1.0 / float(tau))
        low, high = (min(corners), max(corners)) if corners else (1.0, 1.0)
        return np.geomspace(below * low, beyond * high, 2001)


def _frequencies(omega: ArrayLike) -> NDArray[np.float64]:
    frequencies = real_array("omega", omega)
    if not np.isfinite(frequencies).all():
        raise ValueError("omega: give finite frequencies in rad/s")
    return frequencies
