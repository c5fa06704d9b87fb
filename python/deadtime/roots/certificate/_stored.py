"""Proofs as text and as objects of unknown origin: their form follows from the types of the fields.

A proof is a dataclass whose fields are real, complex and whole numbers, words, tuples of these, and
further dataclasses. As text it is JSON with the names of the fields, and with real numbers in
hexadecimal so that none is rounded. Reading and checking take time in proportion to the length.
Whether the claims are true is checked elsewhere.
"""

from __future__ import annotations

import dataclasses
import json
import reprlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import UnionType
from typing import Any, ClassVar, Literal, Self, Union, get_args, get_origin, get_type_hints

from deadtime._base.errors import CertificateError

_WORDS: dict[Any, str] = {
    int: "a whole number",
    float: "a real number",
    complex: "a complex number",
    bool: "True or False",
    tuple: "a tuple",
}


class Stored:
    """Base of proofs that can be written as JSON and read again."""

    #: What the text calls its format, and what errors call the proof.
    _FORMAT: ClassVar[str]
    _NOUN: ClassVar[str]

    def _check_form(self) -> None:
        """Refuse values that no such proof has, with a ValueError."""
        check_types(self)

    def to_json(self, indent: int | None = None) -> str:
        """Write the proof as JSON, with numbers in hexadecimal so that none is rounded.

        Parameters
        ----------
        indent : int, optional
            As in `json.dumps`.

        Returns
        -------
        str
        """
        return json.dumps({"format": self._FORMAT, **_plain(self)}, indent=indent)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Read what `to_json` wrote; only the form is checked, `verify` checks the claims.

        Parameters
        ----------
        text : str

        Returns
        -------
        Self
            A proof of this class.

        Raises
        ------
        ValueError
            If the text is not such a proof, or contains numbers that no such proof has.
        """
        wrong = f"this is not the text of a {cls._NOUN}"
        try:
            data = json.loads(text)
            if data.pop("format") != cls._FORMAT:
                raise KeyError("format")
            read: Self = _read_fields((cls,), data)
            read._check_form()
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise ValueError(f"{wrong}: {error}") from error
        except RecursionError:
            raise ValueError(f"{wrong}: its brackets are nested too deeply") from None
        return read


@contextmanager
def refusing(noun: str) -> Iterator[None]:
    """Turn errors of form and arithmetic during a check into a CertificateError."""
    try:
        yield
    except (OverflowError, ZeroDivisionError, ValueError, IndexError, TypeError) as error:
        raise CertificateError(
            f"the {noun} contains a number or a part that is not possible: {error}"
        ) from error


def check_types(proof: Any) -> None:
    """Check that all parts have the types of their fields, and that none is NaN.

    Raises
    ------
    ValueError
        If a part has another type; the message names the first one.
    """
    kind: Any = type(proof)
    for name, hint in _hints(kind).items():
        _check(name, getattr(proof, name), hint)


def _plain(value: Any) -> Any:
    """Convert a value to types of JSON; floats and complex numbers become hexadecimal text."""
    if dataclasses.is_dataclass(value):
        fields = dataclasses.fields(value)
        return {field.name: _plain(getattr(value, field.name)) for field in fields}
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, complex):
        return [value.real.hex(), value.imag.hex()]
    return value.hex() if isinstance(value, float) else value


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """The types of the fields of a dataclass."""
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


@cache
def _options(hint: Any) -> tuple[Any, ...]:
    """The types of a union; one type alone is a union of one."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _types_of_parts(kind: Any, number: int) -> tuple[Any, ...]:
    """The types of the parts of a tuple, which has this number of parts."""
    kinds = get_args(kind)
    kinds = (kinds[0],) * number if kinds[-1] is Ellipsis else kinds
    if len(kinds) != number:
        raise ValueError(f"{number} parts instead of {len(kinds)}")
    return kinds


def _read(hint: Any, data: Any) -> Any:
    """A value of a type from its text; what is written as itself is left to the check."""
    options = _options(hint)
    if data is None and type(None) in options:
        return None
    kind = options[0]
    if dataclasses.is_dataclass(kind):
        return _read_fields(options, data)
    if get_origin(kind) is tuple:
        kinds = _types_of_parts(kind, len(_list(data)))
        return tuple(map(_read, kinds, data))
    if kind is complex:
        real, imag = map(_number, _list(data))
        return complex(real, imag)
    return _number(data) if kind is float else data


def _read_fields(kinds: tuple[Any, ...], data: Any) -> Any:
    """An object of the one of these dataclasses that has the fields of the text."""
    for kind in kinds:
        hints = _hints(kind)
        if hints.keys() == data.keys():
            return kind(**{name: _read(hint, data[name]) for name, hint in hints.items()})
    differing = sorted(_hints(kinds[0]).keys() ^ data.keys())
    raise KeyError(f"these fields are missing or unknown: {reprlib.repr(differing)}")


def _list(data: Any) -> list[Any]:
    if not isinstance(data, list):
        raise TypeError(f"there is {reprlib.repr(data)} instead of a list")
    return data


def _number(text: Any) -> float:
    if not isinstance(text, str):
        raise TypeError(f"there is {reprlib.repr(text)} instead of a number in hexadecimal")
    return float.fromhex(text)


def _check(name: str, value: Any, hint: Any) -> None:
    """Refuse a value of another type, and NaN."""
    options = _options(hint)
    if value is None and type(None) in options:
        return
    kind = options[0]
    if dataclasses.is_dataclass(kind):
        if not isinstance(value, options):
            expected = " or ".join(option.__name__ for option in options)
            raise ValueError(f"{name} is {reprlib.repr(value)}, but it must be a {expected}")
        used: Any = type(value)
        for field, part in _hints(used).items():
            _check(f"{name}.{field}", getattr(value, field), part)
    elif get_origin(kind) is tuple:
        _is(name, value, tuple)
        try:
            kinds = _types_of_parts(kind, len(value))
        except ValueError as error:
            raise ValueError(f"{name} has {error}") from None
        for number, (part, of) in enumerate(zip(value, kinds, strict=True)):
            _check(f"{name}[{number}]", part, of)
    elif get_origin(kind) is Literal:
        if not isinstance(value, str) or value not in get_args(kind):
            raise ValueError(
                f"{name} is {reprlib.repr(value)}, but it must be one of {get_args(kind)}"
            )
    else:
        _is(name, value, kind)


def _is(name: str, value: Any, kind: type) -> None:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise ValueError(f"{name} is {reprlib.repr(value)}, but it must be {_WORDS[kind]}")
    if kind in (float, complex) and value != value:
        raise ValueError(f"{name} is {value}, but it must be {_WORDS[kind]}")
