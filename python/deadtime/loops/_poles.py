"""Poles of a control loop, and the stability that follows from them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import SupportsFloat

import numpy as np
from numpy.typing import NDArray

from deadtime._base.validation import OpenRange, Range, open_interval, whole_number
from deadtime.loops._specification import LoopSpecification
from deadtime.roots import (
    Crossings,
    ParametricQuasiPolynomial,
    QuasiPolynomial,
    RootSet,
    crossings,
    proves_instability,
    root_set,
)
from deadtime.roots.certificate import Certificate

#: Numbers of a loop that move no pole of it.
MOVES_NO_POLE = (
    "limit", "limit_low", "limit_high", "rate_limit", "tracking_time", "weight",
    "derivative_weight", "feed_forward",
)  # fmt: skip


class LoopPoles:
    """The poles of a `ControlLoop`; its limit is left out throughout."""

    specification: LoopSpecification

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
        self.specification.refuse_hold(
            "has finitely many poles, and no characteristic quasi-polynomial: use "
            "transition_matrix() or rightmost(). For the loop without its hold, use "
            "continuous().characteristic()"
        )
        loop = self.specification
        _ = loop.known_delay
        return QuasiPolynomial._wrap(loop.kernel.characteristic())

    def count(self, re: OpenRange | None = None, im: OpenRange | None = None) -> int:
        """Count the poles in a region, with multiplicity.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            Ranges of the real part (1/s) and of the imaginary part (rad/s); None is an open end.

        Returns
        -------
        int
            Proved, as in `QuasiPolynomial.count`.

        Raises
        ------
        ContourError, ValueError
            As in `poles`.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(5.0), delay=0.36, sample_time=0.065)
        >>> loop.count(re=(0, None)), loop.continuous().count(re=(0, None))
        (2, 2)
        """
        if self.specification.sample_time is None:
            return self.characteristic().count(re, im)
        return self.poles(re, im).counted

    def poles(self, re: OpenRange | None = None, im: OpenRange | None = None) -> RootSet:
        """Locate every pole in a region.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `count`. Poles of a sampled loop have imaginary parts up to pi/sample_time.

        Returns
        -------
        RootSet
            As of `rightmost`.

        Raises
        ------
        ContourError
            If a pole lies on the edge of the region, or closer to it than rounding.
        ValueError
            If the delay is None, or the region holds infinitely many poles.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
        >>> print(loop.poles(re=(-5, 0), im=(0, 10)).roots.round(4))
        [-1.2381+2.9974j]
        """
        loop = self.specification
        if loop.sample_time is None:
            return self.characteristic().roots(re, im)
        return root_set(loop.native.poles_in(open_interval("re", re), open_interval("im", im)))

    def certify(self, re: OpenRange | None = None, im: OpenRange | None = None) -> Certificate:
        """Count the poles of a continuous loop in a region and write the proof down.

        Parameters
        ----------
        re, im : tuple of (float or None, float or None), optional
            As in `count`.

        Returns
        -------
        Certificate
            As of `QuasiPolynomial.certify`.

        Raises
        ------
        ContourError, ValueError
            As in `QuasiPolynomial.certify`; ValueError also for a sampled loop, whose poles are
            eigenvalues.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36)
        >>> loop.certify(re=(0, None)).verify()
        0
        """
        return self.characteristic().certify(re, im)

    def rightmost(self, n: int = 1) -> RootSet:
        """Return the `n` rightmost poles, limit left out.

        Parameters
        ----------
        n : int
            How many, not counting mirror images in the real axis, which are listed as well.

        Returns
        -------
        RootSet
            Roots of `characteristic`, or s = ln(z)/sample_time for the eigenvalues z of
            `transition_matrix`, in discs that are proved to hold them. Eigenvalues z = 0, whose
            motion is gone after a sample, are left out, so that there may be fewer than `n`.

        Raises
        ------
        ValueError
            If the delay is None or `n` is less than one.
        """
        period = self.specification.sample_time
        number = whole_number("n", n)
        if period is None:
            return self.characteristic().rightmost(number)
        return root_set(self.specification.native.rightmost(number))

    def spectral_abscissa(self, strong: bool = True) -> float:
        """Return the largest real part of the poles in 1/s, limit left out.

        Small deviations from rest grow or decay like exp(abscissa t).

        Parameters
        ----------
        strong : bool, default True
            As in `QuasiPolynomial.spectral_abscissa`; without meaning for a sampled loop.

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
        loop = self.specification
        if loop.sample_time is None:
            return self.characteristic().spectral_abscissa(strong)
        return loop.native.abscissa()

    def is_stable(self, strong: bool = True) -> bool:
        """Whether every pole lies left of the imaginary axis, limit left out.

        Parameters
        ----------
        strong : bool, default True
            A neutral loop must stay so under small changes of the delay, as in
            `QuasiPolynomial.is_stable`; without meaning for a sampled loop.

        Returns
        -------
        bool

        Raises
        ------
        ValueError
            If the delay is None; if a pole of a sampled loop is as near to the unit circle as
            rounding.
        """
        loop = self.specification
        if loop.sample_time is None:
            return self.characteristic().is_stable(strong)
        found = loop.native.is_stable()
        if found is None:
            near = self.rightmost()
            raise ValueError(
                f"a pole at {near[0]:.6g} 1/s is known only to {near.radii[0]:.1e} 1/s, and is "
                "closer to the imaginary axis than this error. So double precision cannot "
                "decide whether this loop is stable. Change a gain, or take a sample_time "
                "closer to the time constants of the loop"
            )
        return found

    def crossings(
        self, ranges: Mapping[str, Range], *, at: Mapping[str, SupportsFloat] | None = None
    ) -> Crossings:
        """Every crossing of the imaginary axis as one named number of a continuous loop varies.

        Parameters
        ----------
        ranges : mapping of str to (float, float)
            The number that varies, and from where to where.
        at : mapping of str to float, optional
            Other values of other numbers.

        Returns
        -------
        Crossings
            As of `deadtime.crossings`.

        Raises
        ------
        ValueError
            As in `deadtime.crossings`; also for a sampled loop.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36)
        >>> print(loop.crossings({"Kp": (0.1, 6)}).values.round(4))
        [4.3633]
        """
        return crossings(self, ranges, at=at)

    def stable_range(self, name: str) -> tuple[float, float]:
        """Interval of one named number, around its present value, on which the loop is stable.

        The ends are the nearest values on either side at which a pole reaches the edge of
        stability, or a neutral loop loses strong stability. They are the next of all crossings, or
        no pole is on the edge before them, proved, so that none is passed over.

        Parameters
        ----------
        name : str
            One of `parameters` that moves a pole: no limit, no weight of the reference.

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
        Not proved are limits of a sampled loop: an infinite end of a number that is neither a gain
        nor the delay, below a millionth of a value, and short samples of which the hold matters no
        more. A `ParametricPlant` needs polynomials that add, subtract and multiply its numbers.

        Of a neutral loop the last hundredth of the way to where it loses strong stability is
        halved, not searched for all crossings.

        Examples
        --------
        The hold costs stability:

        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
        >>> low, high = loop.stable_range("Kp")
        >>> round(high, 3), round(loop.continuous().stable_range("Kp")[1], 3)
        (4.024, 4.363)
        """
        loop = self.specification
        values = loop.parameters
        if name not in values or name in MOVES_NO_POLE:
            raise ValueError(
                f"{name!r} is not a parameter with a stable range: choose one of "
                f"{', '.join(known for known in values if known not in MOVES_NO_POLE)}"
            )
        if not self.is_stable():
            raise ValueError(
                f"at {name}={values[name]} the loop is not stable: start from a stable loop, "
                "for example with lower gains"
            )
        return loop.stable_range(name)

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
        if self.specification.sample_time is None:
            raise ValueError(
                "a continuous loop has no transition matrix: use characteristic(), or give the "
                "loop a sample_time"
            )
        return self.specification.native.transition_matrix()

    def _family_of(self, names: Collection[str]) -> ParametricQuasiPolynomial:
        """Characteristic function with the numbers `names` as its parameters."""
        loop = self.specification
        loop.refuse_hold(
            "has poles that are eigenvalues, and no characteristic function for a proof. Use "
            "loop.continuous() for the loop without its hold, or dtm.stability_map for single "
            "cells"
        )
        return loop.family_of(tuple(names))


def is_unstable(loop: LoopSpecification) -> bool:
    """Whether the loop is proved to be unstable, its limit left out."""
    if loop.sample_time is None:
        return proves_instability(QuasiPolynomial._wrap(loop.kernel.characteristic()).rightmost())
    return proves_instability(root_set(loop.native.rightmost(1)))
