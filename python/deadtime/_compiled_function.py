"""Addresses of functions that are compiled already: ctypes, numba, scipy.LowLevelCallable."""

from __future__ import annotations

import ctypes
from typing import Any

import scipy

__all__ = ["addresses"]

_capsule = ctypes.pythonapi
_FunctionPointer: Any = ctypes.CFUNCTYPE(None).__base__


def addresses(function: Any) -> tuple[int, int] | None:
    """Return the addresses of a C function and of its user data, None for a Python function."""
    if isinstance(function, scipy.LowLevelCallable):
        return _of_capsule(tuple.__getitem__(function, 0))
    if isinstance(function, _FunctionPointer):
        address = ctypes.cast(function, ctypes.c_void_p).value
    else:
        address = getattr(function, "address", None)
        if not isinstance(address, int):
            return None
    if not address:
        raise ValueError(f"fun={function!r} is a null pointer: give a function")
    return address, 0


def _of_capsule(capsule: object) -> tuple[int, int]:
    name = _call("PyCapsule_GetName", ctypes.c_char_p, capsule)
    address = _call("PyCapsule_GetPointer", ctypes.c_void_p, capsule, name)
    return address, _call("PyCapsule_GetContext", ctypes.c_void_p, capsule) or 0


def _call(function: str, result: Any, capsule: object, *name: bytes) -> Any:
    types: Any = (ctypes.py_object, *(ctypes.c_char_p for _ in name))
    return ctypes.PYFUNCTYPE(result, *types)((function, _capsule))(capsule, *name)
