"""The bounds of a number, which stand in its type: checks and options of commands read them there.

A field is written as ``noise: Annotated[float, Bounds(0.0, 10.0)]``.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from deadtime._base.validation import finite


class Bounds(NamedTuple):
    """The least and the largest value; None for no bound.

    Examples
    --------
    >>> Bounds(0.0, 10.0).check("noise", 11.0)
    Traceback (most recent call last):
    ValueError: noise=11: give a number from 0 to 10
    """

    low: float | None = None
    high: float | None = None

    def check(self, name: str, value: float) -> float:
        """Return `value` as a finite float within the bounds, or raise."""
        number = finite(name, value)
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        if low <= number <= high:
            return number
        if self.high is None:
            raise ValueError(f"{name}={number:g}: give {low:g} or more")
        if self.low is None:
            raise ValueError(f"{name}={number:g}: give {high:g} or less")
        raise ValueError(f"{name}={number:g}: give a number from {low:g} to {high:g}")


def without_bounds(annotation: Any) -> tuple[Any, Bounds]:
    """A type, and the bounds that are written beside it."""
    if get_origin(annotation) is not Annotated:
        return annotation, Bounds()
    kind, *notes = get_args(annotation)
    return kind, next((note for note in notes if isinstance(note, Bounds)), Bounds())


def check_bounds(made: object) -> None:
    """Refuse an object of a frozen dataclass with a field outside its bounds.

    Numbers in a field of type float become floats; None is in no range.
    """
    for name, annotation in get_type_hints(type(made), include_extras=True).items():
        kind, bounds = without_bounds(annotation)
        value = getattr(made, name)
        if bounds == Bounds() or value is None:
            continue
        number = bounds.check(name, value)
        if kind is float or float in get_args(kind):
            object.__setattr__(made, name, number)
