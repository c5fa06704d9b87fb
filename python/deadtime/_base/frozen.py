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


def equal(left: Any, right: Any) -> bool:
    """Whether two values are the same; NaN is the same as NaN."""
    if left is right:
        return True
    if isinstance(left, np.ndarray) or isinstance(right, np.ndarray):
        if type(left) is not type(right) or left.shape != right.shape or left.dtype != right.dtype:
            return False
        return bool(np.array_equal(left, right, equal_nan=left.dtype.kind in "fc"))
    if isinstance(left, Mapping) and isinstance(right, Mapping):
        return left.keys() == right.keys() and all(equal(left[key], right[key]) for key in left)
    if isinstance(left, (list, tuple)) and isinstance(right, (list, tuple)):
        same = type(left) is type(right) and len(left) == len(right)
        return same and all(map(equal, left, right))
    return bool(left == right) or (left != left and right != right)


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
