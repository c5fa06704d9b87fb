"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    Certificate as Certificate,
    CharacteristicMatrix as CharacteristicMatrix,
    Family as Family,
    Monotone as Monotone,
    QuasiPolynomial as QuasiPolynomial,
    Ratio as Ratio,
    RootSet as RootSet,
    Segment as Segment,
    crossings as crossings,
    dde_root_number as dde_root_number,
    dde_roots as dde_roots,
    delay_margin as delay_margin,
)
