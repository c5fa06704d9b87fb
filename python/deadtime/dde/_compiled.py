"""Addresses of functions that are compiled already: ctypes, numba, scipy.LowLevelCallable."""

from __future__ import annotations

import ctypes
from _ctypes import CFuncPtr
from typing import Any

_SIGNATURE = "void (double, double *, double *, double *, double *, void *)"
_NUMBERS = 4  # pointers to doubles between the time and the user data

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

    A signature that is known and is not that of a right-hand side raises ValueError. Functions
    of a `ctypes` library without ``argtypes`` do not know theirs.
    """
    import scipy

    if isinstance(function, scipy.LowLevelCallable):
        capsule = tuple.__getitem__(function, 0)
        name = _name(capsule)
        signature = name.decode().replace("const ", "")
        if signature.replace(" ", "") != _SIGNATURE.replace(" ", ""):
            raise _refusal(signature)
        return int(_pointer(capsule, name)), int(_context(capsule) or 0)
    if isinstance(function, CFuncPtr):
        _check_ctypes(function)
        address = ctypes.cast(function, ctypes.c_void_p).value
    elif hasattr(function, "_sig") and isinstance(getattr(function, "address", None), int):
        _check_numba(function._sig)
        address = function.address
    else:
        return None
    if not address:
        raise ValueError(f"fun={function!r} is a null pointer: give a function")
    return address, 0


def _check_ctypes(function: Any) -> None:
    """Refuse a ctypes function whose declared types are others."""
    types, result = function.argtypes, function.restype
    if types is None:
        return
    pointers = (ctypes.POINTER(ctypes.c_double), ctypes.c_void_p)
    fits = (
        len(types) == _NUMBERS + 2
        and types[0] is ctypes.c_double
        and all(kind in pointers for kind in types[1:-1])
        and (types[-1] is ctypes.c_void_p or issubclass(types[-1], ctypes._Pointer))
        # The default of a function of a ctypes library.
        and result in (None, ctypes.c_int)
    )
    if not fits:
        names = ", ".join(kind.__name__ for kind in types)
        raise _refusal(f"{getattr(result, '__name__', 'void')} ({names})")


def _check_numba(signature: Any) -> None:
    """Refuse a numba cfunc that was compiled for other types."""
    types = [str(kind) for kind in signature.args]
    numbers = ["float64", *["float64*"] * _NUMBERS]
    fits = types[:-1] == numbers and types[-1].endswith("*")
    if not fits or str(signature.return_type) != "none":
        raise _refusal(f"{signature.return_type} ({', '.join(types)})")


def _refusal(signature: str) -> ValueError:
    return ValueError(
        f"fun has the signature {signature}, but it must have the signature {_SIGNATURE}"
    )
