"""Characteristic roots with the evidence that they are right and that none is missing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from deadtime._base.drawing import Axes, shown_axes
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured

if TYPE_CHECKING:
    import deadtime.roots._native as native
    from deadtime.roots._chains import Chain


_SHOWN = 12


@dataclass(frozen=True, eq=False, repr=False)
class RootSet(ReadOnlyArrays, Pictured):
    """Roots of a quasi-polynomial, each the centre of a disc proved to hold it.

    Behaves like the array of its roots: it has a length, can be indexed and iterated over, and
    NumPy takes it for an array. Sorted by falling real part, then rising modulus of the imaginary
    part, then the upper one of a pair first. Two are equal where all that they hold is, discs and
    region included; a root set and an array never are: compare ``found.roots``.

    Attributes
    ----------
    roots : ndarray of complex, shape (n,)
        Centres of the discs, in 1/s.
    multiplicities : ndarray of int, shape (n,)
        How many roots the disc holds.
    radii : ndarray of float, shape (n,)
        Radii of the discs, in 1/s: every root is within the radius of its centre.
    resolved : ndarray of bool, shape (n,)
        Is the disc one point to working precision? A single root, or several within 1e-12 of
        their distance from 0; not so a cluster that is wider and cannot be told apart.
    counted : int
        Number of roots in `region` by the argument principle; equal to the sum of the
        multiplicities.
    region : tuple of (float, float)
        The ranges of the real and of the imaginary part, `((a, b), (c, d))`, in which the roots
        listed are all there are.
    hidden : ndarray of complex
        Of the poles of a `TransferFunction`: roots of its denominator in `region` that are roots of
        the numerator as well, each as often as it is one. They are not among `roots`.
    chain_abscissa : float
        Of `rightmost` where the chains of a neutral system leave fewer roots than were asked for:
        the real part that these can come to, in 1/s. Otherwise -inf.

    Examples
    --------
    >>> import deadtime as dtm
    >>> found = (dtm.s + dtm.delay(1.0)).roots(re=(-3, 2), im=(0, 20))
    >>> found.counted
    3
    >>> abs(found[0] - (-0.318131505204764 + 1.337235701430689j)) < 1e-14
    True
    """

    roots: NDArray[np.complex128]
    multiplicities: NDArray[np.int64]
    radii: NDArray[np.float64]
    resolved: NDArray[np.bool_]
    counted: int
    region: tuple[tuple[float, float], tuple[float, float]]
    hidden: NDArray[np.complex128] = field(default_factory=lambda: np.empty(0, np.complex128))
    chain_abscissa: float = -math.inf

    def __len__(self) -> int:
        return len(self.roots)

    def __iter__(self) -> Iterator[complex]:
        return iter(self.roots.tolist())

    @overload
    def __getitem__(self, index: int) -> complex: ...
    @overload
    def __getitem__(self, index: slice) -> NDArray[np.complex128]: ...
    def __getitem__(self, index: Any) -> Any:
        """One root as a number, several as an array; any index that NumPy takes."""
        picked = self.roots[index]
        return picked if isinstance(picked, np.ndarray) else complex(picked)

    def __array__(
        self, dtype: np.dtype[Any] | None = None, copy: bool | None = None
    ) -> NDArray[Any]:
        """Give the roots to NumPy."""
        # asarray knows `copy` since NumPy 2 only.
        array = np.asarray(self.roots, dtype=dtype)
        return array.copy() if copy else array

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Work on the roots as on an array, but compare as a whole: ``array == roots`` is False."""
        if method == "__call__" and ufunc in (np.equal, np.not_equal):
            return ufunc is np.not_equal
        plain = [operand.roots if isinstance(operand, RootSet) else operand for operand in inputs]
        return getattr(ufunc, method)(*plain, **options)

    def plot(self, ax: Axes | None = None, chains: Sequence[Chain] = ()) -> Axes:
        """Draw the roots in the complex plane; needs matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; default is a new figure.
        chains : sequence of Chain, optional
            Laws to draw as well, from `QuasiPolynomial.chains`.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from deadtime.roots._plots import plot_root_set

        axes = shown_axes(ax)
        plot_root_set(axes, self, chains)
        return axes

    def __repr__(self) -> str:
        (a, b), (c, d) = self.region
        number = f"{self.counted} root{'' if self.counted == 1 else 's'}"
        lines = [f"RootSet: {number} in re=({a:g}, {b:g}), im=({c:g}, {d:g})"]
        for index in range(min(len(self), _SHOWN)):
            line = f"  {_written(self.roots[index])}  within {self.radii[index]:.1e}"
            if self.multiplicities[index] > 1:
                line += f", {self.multiplicities[index]} roots not resolved"
            lines.append(line)
        if len(self) > _SHOWN:
            lines.append(f"  and {len(self) - _SHOWN} more")
        if math.isfinite(self.chain_abscissa):
            lines.append(f"  further left, chains of roots may approach re={self.chain_abscissa:g}")
        if len(self.hidden):
            listed = ", ".join(map(_written, self.hidden[:_SHOWN]))
            more = " and more" if len(self.hidden) > _SHOWN else ""
            lines.append(f"  hidden, as the numerator is zero there too: {listed}{more}")
        return "\n".join(lines)


def _written(root: complex) -> str:
    return f"{root.real:.15g} {'-' if root.imag < 0 else '+'} {abs(root.imag):.15g}i"


def root_set(found: native.RootSet) -> RootSet:
    """The roots that the native part found."""
    return RootSet(
        roots=found.roots,
        multiplicities=found.multiplicities.astype(np.int64),
        radii=found.radii,
        resolved=found.resolved,
        counted=found.counted,
        region=found.region,
        hidden=found.hidden,
    )


def rightmost_set(found: native.RootSet, n: int, chain: Callable[[], float]) -> RootSet:
    """The rightmost roots, with the chains where they leave fewer than `n`."""
    roots = root_set(found)
    if roots.multiplicities[roots.roots.imag >= 0.0].sum() >= n:
        return roots
    return replace(roots, chain_abscissa=chain())


def proves_instability(rightmost: RootSet) -> bool:
    """Whether one of the rightmost roots, or a chain, is proved to be right of the axis."""
    right = np.any(rightmost.roots.real > rightmost.radii)
    return bool(right) or rightmost.chain_abscissa > 0.0
