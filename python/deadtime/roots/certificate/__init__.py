"""Proofs of root counts, and an independent program that checks them.

`_parts` and `_form` are the proof as data, `_function` and `_enclosures` evaluate with bounds,
`_check` verifies.
"""

from deadtime.roots.certificate._certificate import Certificate

__all__ = ["Certificate"]
