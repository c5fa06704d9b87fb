"""Plants written on the command line, such as ``0.9*delay(0.1)/(s*(0.1*s + 1))``.

The text is parsed as an expression of Python and its tree is evaluated node by node: only numbers,
``s``, ``delay(T)``, ``+ - * / **`` and brackets have a meaning, and nothing else is run.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deadtime.loops import FactoredPlant, FirstOrder, Integrator, Plant
from deadtime.roots import QuasiPolynomial, delay, s
from deadtime.systems import TransferFunction

#: Longest text, and highest power of an expression with s in it: they bound time and memory.
_LONGEST = 500
_HIGHEST = 30

#: Imaginary part of a pole, as a share of the pole, up to which it is real.
_REAL = 1e-4

#: Characters that a message repeats.
_SHOWN = 20

_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}

_MEANING = "write it with s, delay(T), numbers, + - * / ** and brackets"


def plant_from(text: str) -> TransferFunction:
    """The transfer function that a text describes.

    Raises
    ------
    ValueError
        If it describes none; the message says where.
    """
    if len(text) > _LONGEST:
        raise ValueError(f"--plant is a formula of {len(text)} characters: give at most {_LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except SyntaxError as error:
        raise _misread(
            text.strip(), (error.offset or 1) - 1, "this is not a valid formula"
        ) from None
    except (ValueError, RecursionError, MemoryError):
        raise ValueError(f"--plant {text!r} is not a valid formula: {_MEANING}") from None
    found = _Reader(text.strip()).value(tree.body)
    return found if isinstance(found, TransferFunction) else TransferFunction(found)


def with_names(plant: Plant) -> Plant:
    """A plant with at most one zero and one pair of complex poles: its numbers can then be free.

    Any other plant is returned as it is.
    """
    if not plant.is_rational:
        return plant
    num, den = plant.polynomials()
    match num.tolist(), den.tolist():
        case [b], [a, c, 0.0] if a * c > 0.0:
            return Integrator(b / c, lag=a / c)
        case [b], [c, 0.0]:
            return Integrator(b / c)
        case [b], [a, c] if a * c > 0.0:
            return FirstOrder(b / c, time_constant=a / c)
    return _factored(num, den) or plant


def _factored(num: NDArray[np.float64], den: NDArray[np.float64]) -> FactoredPlant | None:
    """The plant by its lags, its zero and a pair of complex poles, if it has no others."""
    integrator = bool(den[-1] == 0.0)
    den = den[: den.size - integrator]
    poles = np.roots(den)
    # Rounding moves equal poles apart by the root of itself, into the plane for a pair.
    is_real = np.abs(poles.imag) <= _REAL * np.abs(poles)
    pair = poles[~is_real]
    if den[-1] == 0.0 or num[-1] == 0.0 or num.size > 2 or pair.size > 2 or np.any(poles.real > 0):
        return None
    lags = sorted((-1.0 / poles.real[is_real]).tolist(), reverse=True)
    zero = float(num[0] / num[-1]) if num.size == 2 else 0.0
    gain = float(num[-1] / den[-1])
    if pair.size:
        frequency = float(np.abs(pair[0]))
        damping = -float(pair.real[0]) / frequency
        return FactoredPlant(lags, gain, zero, integrator, frequency, damping) if damping else None
    return FactoredPlant(lags, gain, zero, integrator) if lags else None


class _Reader:
    """Evaluates the nodes of one text."""

    def __init__(self, text: str) -> None:
        self.text = text

    def value(self, node: ast.expr) -> Any:
        """A number, quasi-polynomial or transfer function."""
        match node:
            case ast.Constant(value=int() | float() as given) if not isinstance(given, bool):
                return self.number(node, given)
            case ast.Name(id="s"):
                return s
            case ast.UnaryOp(op=ast.USub()):
                return -self.value(node.operand)
            case ast.UnaryOp(op=ast.UAdd()):
                return self.value(node.operand)
            case ast.BinOp(op=ast.Pow()):
                return self.power(node)
            case ast.BinOp() if type(node.op) in _OPERATORS:
                return self.joined(node)
            case ast.Call(func=ast.Name(id="delay"), args=[only], keywords=[]):
                return self.late(only)
            case ast.Name():
                raise self.misread(
                    node, f"{node.id!r} is not a name that a formula of --plant may contain"
                )
            case ast.BinOp(op=ast.BitXor()):
                raise self.misread(node, "write a power with **, as in s**2")
            case ast.Call(func=ast.Name(id="exp")):
                raise self.misread(node, "write exp(-T*s) as delay(T)")
        raise self.misread(node, "this expression is not allowed in a plant")

    def joined(self, node: ast.BinOp) -> Any:
        left, right = self.value(node.left), self.value(node.right)
        try:
            found = _OPERATORS[type(node.op)](left, right)
        except ZeroDivisionError:
            raise self.misread(node.right, "the formula divides by zero") from None
        except (ValueError, ArithmeticError) as error:
            raise self.misread(node, str(error)) from None
        return self.number(node, found) if isinstance(found, float) else found

    def power(self, node: ast.BinOp) -> Any:
        base, exponent = self.value(node.left), self.value(node.right)
        if not isinstance(exponent, float):
            raise self.misread(node.right, "an exponent must be a number")
        if not isinstance(base, float):
            if not exponent.is_integer() or abs(exponent) > _HIGHEST:
                raise self.misread(
                    node.right, f"an exponent must be a whole number of at most {_HIGHEST}"
                )
            exponent = int(exponent)
            if exponent < 0 and isinstance(base, QuasiPolynomial):
                base = TransferFunction(base)
        try:
            found = base**exponent
        except ZeroDivisionError:
            raise self.misread(node.left, "the formula divides by zero") from None
        except (ValueError, OverflowError):
            raise self.misread(
                node, "the result of this power exceeds the range of double precision"
            ) from None
        return self.number(node, found) if isinstance(base, float) else found

    def late(self, node: ast.expr) -> QuasiPolynomial:
        time = self.value(node)
        if not isinstance(time, float) or time < 0.0:
            raise self.misread(node, "a delay must be a number of seconds, zero or more")
        return delay(time)

    def number(self, node: ast.expr, value: Any) -> float:
        try:
            number = float(value)
        except (OverflowError, TypeError):  # too large, or complex
            number = math.nan
        if not math.isfinite(number):
            raise self.misread(node, "the formula contains a number that is not finite or not real")
        return number

    def misread(self, node: ast.expr, why: str) -> ValueError:
        # Columns are counted in bytes of UTF-8.
        before = self.text.encode()[: node.col_offset].decode(errors="replace")
        return _misread(self.text, len(before), why)


def _misread(text: str, place: int, why: str) -> ValueError:
    from_here = text[place : place + _SHOWN] or "the end"
    return ValueError(f"--plant: character {place + 1}, at {from_here!r}: {why}; {_MEANING}")
