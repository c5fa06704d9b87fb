"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    Certificate,
    CharacteristicMatrix,
    Family,
    Monotone,
    QuasiPolynomial,
    RootSet,
    Segment,
    crossings,
    dde_root_number,
    dde_roots,
    delay_margin,
)

__all__ = [
    "Certificate",
    "CharacteristicMatrix",
    "Family",
    "Monotone",
    "QuasiPolynomial",
    "RootSet",
    "Segment",
    "crossings",
    "dde_root_number",
    "dde_roots",
    "delay_margin",
]
