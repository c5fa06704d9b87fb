"""Addresses of functions that are compiled already: ctypes, numba, scipy.LowLevelCallable."""

from __future__ import annotations

import ctypes
from _ctypes import CFuncPtr
from typing import Any

import scipy

__all__ = ["addresses"]

_SIGNATURE = "void (double, double *, double *, double *, double *, void *)"
_ARGUMENTS = 6

_name = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(
    ("PyCapsule_GetName", ctypes.pythonapi)
)
_pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)
_context = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object)(
    ("PyCapsule_GetContext", ctypes.pythonapi)
)


def addresses(function: Any) -> tuple[int, int] | None:
    """Return the addresses of a C function and of its user data, None for a Python function.

    A signature that is known and is not that of a right-hand side raises ValueError.
    """
    if isinstance(function, scipy.LowLevelCallable):
        capsule = tuple.__getitem__(function, 0)
        name = _name(capsule)
        signature = name.decode().replace("const ", "")
        if signature.replace(" ", "") != _SIGNATURE.replace(" ", ""):
            raise _refusal(signature)
        return int(_pointer(capsule, name)), int(_context(capsule) or 0)
    if isinstance(function, CFuncPtr):
        types = function.argtypes
        if types is not None and len(types) not in (0, _ARGUMENTS):
            raise _refusal(f"{len(types)} arguments")
        address = ctypes.cast(function, ctypes.c_void_p).value
    else:
        address = getattr(function, "address", None)
        if not isinstance(address, int):
            return None
    if not address:
        raise ValueError(f"fun={function!r} is a null pointer: give a function")
    return address, 0


def _refusal(signature: str) -> ValueError:
    return ValueError(f"fun has the signature {signature}: it must be {_SIGNATURE}")
