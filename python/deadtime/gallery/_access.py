"""The problems of the gallery, and their look-up by citation key."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType

from deadtime.gallery._entries import entries
from deadtime.roots import ParametricQuasiPolynomial, QuasiPolynomial


@dataclass(frozen=True)
class Problem:
    """A problem and its known answers.

    Attributes
    ----------
    key : str
        Citation key: first author and year, and the number of the example if there are several.
    title : str
        What the system is.
    reference : str
        Where it was published.
    h : QuasiPolynomial
        The characteristic function, at `values` where there is a `family`.
    family : ParametricQuasiPolynomial or None
        The characteristic function with the parameters of the source as variables.
    values : mapping of str to float
        The parameters of `h`.
    base_delay : float
        The largest number, in s, of which all delays, as printed in the source, are integer
        multiples (decimals always have one). A single delay is its own base delay.
    rightmost : complex or None
        The rightmost root, Im >= 0, in 1/s: computed in ball arithmetic to 25 digits, and proved
        to be the rightmost one. None if the chains of a neutral equation lie further right, in the
        sense of `QuasiPolynomial.chain_abscissa`.
    multiplicity : int
        Multiplicity of that root.
    region : tuple of (float, float)
        Ranges of the real part (1/s) and of the imaginary part (rad/s) for `count`.
    count : int
        Number of roots in the region, with multiplicity, certified in ball arithmetic.
    published : mapping of str to str
        Further answers, in the words and digits of the source or in closed form.

    Notes
    -----
    Coefficients and delays are doubles, taken as exact. If the source has numbers that are no
    doubles (1/3, 1/e), a multiple root of the source may be a cluster here; `published` then says
    so.
    """

    key: str
    title: str
    reference: str
    h: QuasiPolynomial
    base_delay: float
    rightmost: complex | None
    region: tuple[tuple[float, float], tuple[float, float]]
    count: int
    multiplicity: int = 1
    family: ParametricQuasiPolynomial | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    published: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("values", "published"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __reduce__(self) -> tuple[object, ...]:
        return problem, (self.key,)


@cache
def _problems() -> dict[str, Problem]:
    return {key: Problem(key=key, **fields) for key, fields in entries().items()}


def names() -> tuple[str, ...]:
    """Citation keys of all problems, in alphabetical order.

    Returns
    -------
    tuple of str
    """
    return tuple(_problems())


def problem(key: str) -> Problem:
    """Return the problem with a citation key.

    Parameters
    ----------
    key : str
        One of `names`.

    Returns
    -------
    Problem

    Raises
    ------
    KeyError
        If there is no such problem; the message names the nearest keys.

    Examples
    --------
    >>> from deadtime import gallery
    >>> gallery.problem("hollot2001").title
    'Router queue with a PI controller'
    """
    try:
        return _problems()[key]
    except KeyError:
        near = difflib.get_close_matches(str(key), _problems(), n=3, cutoff=0.3) or names()
        raise KeyError(
            f"the gallery has no problem {key!r}. Similar names are {', '.join(near)}"
        ) from None


def problems() -> Iterator[Problem]:
    """Yield all problems, in the order of `names`.

    Yields
    ------
    Problem

    Examples
    --------
    >>> from deadtime import gallery
    >>> all(p.h.count(*p.region) >= p.count for p in gallery.problems() if p.key == "wright1955")
    True
    """
    yield from _problems().values()
