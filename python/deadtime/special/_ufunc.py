"""Calls of the native ufuncs, with errors that explain what NumPy refuses."""

from __future__ import annotations

from typing import Any, Literal, TypedDict, cast

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

import deadtime.special._native as native
from deadtime._base.validation import thread_number


class UfuncOptions(TypedDict, total=False):
    """Rarely used options of every ufunc."""

    casting: Literal["no", "equiv", "safe", "same_kind", "unsafe"]
    order: Literal["K", "A", "C", "F"]
    subok: bool


def apply(
    ufunc: np.ufunc,
    arguments: tuple[Any, ...],
    options: UfuncOptions,
    out: NDArray[Any] | tuple[NDArray[Any] | None, ...] | None,
    where: ArrayLike,
    dtype: DTypeLike | None,
    threads: int | None,
) -> Any:
    """Call `ufunc`; where it refuses the arguments, say which and why."""
    keywords: dict[str, Any] = cast("dict[str, Any]", options)
    if out is not None:
        keywords["out"] = out
    if where is not True:
        keywords["where"] = where
    if dtype is not None:
        keywords["dtype"] = dtype
    before = None if threads is None else native.limit_threads(thread_number(threads))
    try:
        return ufunc(*arguments, **keywords)
    except (TypeError, ValueError, OverflowError) as error:
        refused = error
    finally:
        if threads is not None:
            native.limit_threads(before)
    _explain(ufunc, arguments)
    raise refused


# The names of the arguments in messages, and the widest type that each may have.
_COMPLEX, _FLOAT, _BRANCH = np.complex128, np.float64, np.int64
_ARGUMENTS: dict[np.ufunc, dict[str, type]] = {
    native.lambertw: {"z": _COMPLEX, "k": _BRANCH},
    native.lambertw0: {"x": _FLOAT},
    native.lambertwm1: {"x": _FLOAT},
    native.lambertw_log: {"log_z": _COMPLEX, "k": _BRANCH},
    native.wrightomega: {"z": _COMPLEX},
    native.lambertw_derivative: {"z": _COMPLEX, "k": _BRANCH},
    native.lambertw_offset: {"delta": _COMPLEX, "k": _BRANCH},
    native.dde_roots: {"a0": _FLOAT, "a1": _FLOAT, "delay": _FLOAT, "k": _BRANCH},
}


def _explain(ufunc: np.ufunc, arguments: tuple[Any, ...]) -> None:
    """Raise an error that names the wrong argument; return if the arguments are right."""
    if any(foreign(values) for values in arguments):
        return
    shapes = {}
    for (name, widest), values in zip(_ARGUMENTS[ufunc].items(), arguments, strict=True):
        if widest is _BRANCH:
            shapes[name] = _integers(name, values).shape
        else:
            shapes[name] = _numbers(name, values, widest).shape
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(f"the shapes of the arguments do not broadcast: {listed}") from None


def foreign(values: object) -> bool:
    """Whether the object handles ufuncs itself."""
    way = getattr(type(values), "__array_ufunc__", None)
    return way is not None and way is not np.ndarray.__array_ufunc__


def branches(k: ArrayLike) -> Any:
    """Convert branches so that NumPy casts them correctly: it would wrap the largest uint64."""
    if type(k) is int or getattr(k, "dtype", None) is _INT64 or foreign(k):
        return k
    return _integers("k", k)


_INT64 = np.dtype(np.int64)


def _numbers(name: str, values: ArrayLike, widest: type) -> NDArray[Any]:
    array = np.asanyarray(values)
    if not np.can_cast(array.dtype, widest, "safe"):
        kind = "real" if widest is np.float64 else "real or complex"
        raise TypeError(
            f"{name} has dtype {array.dtype}: give {kind} numbers of at most double precision"
        )
    return array


def finite(name: str, values: ArrayLike, where: ArrayLike) -> Any:
    if foreign(values):
        return values
    array = _numbers(name, values, np.float64)
    refuse(array, ~np.isfinite(array), where, f"{name} must be finite")
    return array


def _integers(name: str, values: ArrayLike) -> NDArray[np.int64]:
    array = np.asanyarray(values)
    if array.dtype.kind not in "iu":
        example = next(iter(array.ravel()[:1].tolist()), None)
        if array.dtype == object and array.size and all(type(i) is int for i in array.flat):
            raise ValueError(
                f"{name}={_largest(array)} is too large: give a branch number that fits a 64-bit "
                "integer"
            )
        raise TypeError(
            f"{name}={example!r} (dtype {array.dtype}) is not an integer: give the number of a "
            "branch, such as 0 or -1"
        )
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise ValueError(
            f"{name}={_largest(array)} is too large: give a branch number that fits a 64-bit "
            "integer"
        )
    return array.astype(np.int64, copy=False)


def _largest(array: NDArray[Any]) -> int:
    return max((int(i) for i in array.flat), key=abs)


def refuse(values: NDArray[Any], bad: NDArray[np.bool_], where: ArrayLike, reason: str) -> None:
    if where is not True:
        bad, values = np.broadcast_arrays(np.logical_and(bad, where), values)
    if bad.any():
        raise ValueError(f"{reason}, got {values[bad].flat[0]}")
