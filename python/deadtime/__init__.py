"""Control loops with a delay in them."""

from deadtime._quasipolynomial import QuasiPolynomial, delay, s
from deadtime._rootset import RootSet

__all__ = ["QuasiPolynomial", "RootSet", "delay", "s"]
