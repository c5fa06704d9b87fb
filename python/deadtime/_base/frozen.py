"""Immutable results, also after pickling and copying."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, NoReturn, TypeVar, cast

import numpy as np

_Value = TypeVar("_Value")


class FrozenDict(dict[Any, Any]):
    """A dict that does not change; ``dict(found)`` makes one that does."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(
            "a dict of a result cannot be changed: make a copy with dict(...), and change the copy"
        )

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[type[FrozenDict], tuple[dict[Any, Any]]]:
        return FrozenDict, (dict(self),)


class Immutable:
    """Base of objects whose attributes are set once, with ``object.__setattr__``."""

    __slots__ = ()

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(
            f"a {type(self).__name__} cannot be changed, so its attribute {name!r} cannot be set"
        )

    def __delattr__(self, name: str) -> None:
        raise AttributeError(
            f"a {type(self).__name__} cannot be changed, so its attribute {name!r} cannot be "
            "deleted"
        )


class PickledByFields:
    """Base of frozen dataclasses that leave out what they keep for speed when they are pickled."""

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]


def read_only(value: _Value) -> _Value:
    """Return an array that cannot be written to, or a dict that cannot, with such values.

    An array is made read-only itself, a dict is copied.
    """
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, dict):
        frozen = FrozenDict({name: read_only(part) for name, part in value.items()})
        return cast(_Value, frozen)
    elif isinstance(value, Mapping):
        for part in value.values():
            read_only(part)
    elif type(value) in (list, tuple):
        for part in cast("list[Any]", value):
            read_only(part)
    return value


def equal(one: Any, other: Any) -> bool:
    """Whether two values are the same; NaN is the same as NaN."""
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if type(one) is not type(other) or one.shape != other.shape or one.dtype != other.dtype:
            return False
        return bool(np.array_equal(one, other, equal_nan=one.dtype.kind in "fc"))
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(equal(one[key], other[key]) for key in one)
    if isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        same = type(one) is type(other) and len(one) == len(other)
        return same and all(map(equal, one, other))
    return bool(one == other) or (one != one and other != other)


class ReadOnlyArrays:
    """Base of results: their arrays and dicts do not change, and they can be compared.

    Two results are equal where they are of one type and all that they show is equal, NaN to NaN;
    what a result keeps for its own use does not count. With anything else they are not equal.

    NumPy forgets that an array is read-only when it is pickled or copied deeply, so the arrays
    of the copy are frozen again.
    """

    def __post_init__(self) -> None:
        self._freeze()

    def _freeze(self) -> None:
        for name, value in vars(self).items():
            self.__dict__[name] = read_only(value)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update({name: read_only(value) for name, value in state.items()})

    def _shown(self) -> dict[str, Any]:
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return {name: getattr(self, name) for name in names if not name.startswith("_")}

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return equal(self._shown(), other._shown())

    def __hash__(self) -> int:
        sizes = {name: value.shape for name, value in self._shown().items()
                 if isinstance(value, np.ndarray)}  # fmt: skip
        return hash((type(self).__qualname__, tuple(sorted(sizes.items()))))
