"""Proofs of root counts, and an independent program that checks them.

`_stored` is the form of a proof as text and as an object, and `_enclosures` exact numbers and
bounds: both serve other proofs too. `_parts` and `_form` are the proof of a count as data,
`_function` evaluates with bounds, `_check` verifies.
"""

from deadtime.roots.certificate._certificate import Certificate
from deadtime.roots.certificate._enclosures import exponential_between, scaled, whole
from deadtime.roots.certificate._stored import Stored, check_types, refusing

__all__ = [
    "Certificate",
    "Stored",
    "check_types",
    "exponential_between",
    "refusing",
    "scaled",
    "whole",
]
