"""Problems of the literature by citation key, with their known answers.

Systems that others have published, as quasi-polynomials: to try an algorithm on, to compare
programs with, to learn from. Data only.

Examples
--------
>>> from deadtime import gallery
>>> gallery.names()[:3]
('appeltans2023-2.12', 'appeltans2023-2.6', 'appeltans2023-2.9')
>>> problem = gallery.problem("wright1955")
>>> problem.h
s + 1.57079632679 exp(-1 s)
>>> problem.rightmost
1.5707963267948966j
>>> sorted(p.key for p in gallery.problems() if p.h.kind == "neutral")[0]
'appeltans2023-2.12'
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from deadtime.gallery._entries import ENTRIES
from deadtime.roots import ParametricQuasiPolynomial, QuasiPolynomial

__all__ = ["Problem", "names", "problem", "problems"]


@dataclass(frozen=True)
class Problem:
    """A problem and what is known of it.

    Attributes
    ----------
    key : str
        Citation key: first author and year, and the example's number where there are several.
    title : str
        What the system is.
    reference : str
        Where it was published.
    h : QuasiPolynomial
        The characteristic function, at `values` where there is a `family`.
    family : ParametricQuasiPolynomial or None
        The same with the source's parameters left open.
    values : mapping of str to float
        The parameters of `h`.
    base_delay : float
        The largest number, in s, of which all delays are whole multiples as the source writes them
        (decimals always have one). The only delay itself where there is but one.
    rightmost : complex or None
        The rightmost root, Im >= 0, in 1/s: computed in ball arithmetic to 25 digits, and proved
        to be the rightmost one. None where the chains of a neutral equation lie further right, in
        the sense of `QuasiPolynomial.chain_abscissa`.
    multiplicity : int
        Multiplicity of that root.
    region : tuple of (float, float)
        Ranges of the real part (1/s) and of the imaginary part (rad/s) for `count`.
    count : int
        Number of roots in the region, with multiplicity: certified in ball arithmetic.
    published : mapping of str to str
        Further answers, in the source's words and digits or in closed form.

    Notes
    -----
    Coefficients and delays are doubles, taken as exact; where the source gives exact ones
    (1/3, 1/e), a multiple root of the source may be a cluster here, and `published` says so.
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


_PROBLEMS = {key: Problem(key=key, **entry) for key, entry in sorted(ENTRIES.items())}


def names() -> tuple[str, ...]:
    """Citation keys of all problems, in alphabetical order.

    Returns
    -------
    tuple of str
    """
    return tuple(_PROBLEMS)


def problem(key: str) -> Problem:
    """Look a problem up by its citation key.

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
        return _PROBLEMS[key]
    except KeyError:
        near = difflib.get_close_matches(str(key), _PROBLEMS, n=3, cutoff=0.3) or names()
        raise KeyError(f"no problem {key!r} in the gallery: there is {', '.join(near)}") from None


def problems() -> Iterator[Problem]:
    """Go through all problems, in the order of `names`.

    Yields
    ------
    Problem

    Examples
    --------
    >>> from deadtime import gallery
    >>> all(p.h.count(*p.region) >= p.count for p in gallery.problems() if p.key == "wright1955")
    True
    """
    yield from _PROBLEMS.values()
