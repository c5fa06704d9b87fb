"""Quasi-polynomials, their characteristic roots, and where roots cross the imaginary axis.

`s` and `delay` make a `QuasiPolynomial`, which answers questions about its roots. With `parameters`
it is a `ParametricQuasiPolynomial`, whose numbers have names; `crossings` varies one of them.
`dde_roots` serves the scalar equation. A `Certificate` is the proof of a count, which an
independent program checks.
"""

# The files. `_quasipolynomial` and `_parametric` are the functions, `_characteristic` the questions
# about their roots, `_root_set`, `_chains`, `_sensitivity` and `_expansion` the answers.
# `_crossings` varies one number, `_ratio` leaves out the roots of a numerator. `_determinant` and
# `_matrix_roots` serve systems of matrices, `_scalar_delay` the scalar equation. `_exponential`
# says how a delay is written. `certificate` holds proofs of root counts and an independent program
# that checks them.

from deadtime.roots._chains import Chain
from deadtime.roots._characteristic import Edge as Edge
from deadtime.roots._crossings import (
    Crossings,
    crossings,
    delay_margin,
    margin_of_family as margin_of_family,
)
from deadtime.roots._determinant import (
    expanded as expanded,
    expanded_and_exact as expanded_and_exact,
)
from deadtime.roots._expansion import Expansion
from deadtime.roots._exponential import NoExponential as NoExponential
from deadtime.roots._family import HasFamily as HasFamily, family_of as family_of
from deadtime.roots._matrix_roots import (
    MatrixDeterminant as MatrixDeterminant,
    RoundedExpansion as RoundedExpansion,
)
from deadtime.roots._parametric import Parameter, ParametricQuasiPolynomial, parameters
from deadtime.roots._plots import plot_root_set as plot_root_set
from deadtime.roots._quasipolynomial import QuasiPolynomial, delay, is_number as is_number, s
from deadtime.roots._ratio import Ratio as Ratio
from deadtime.roots._root_set import (
    RootSet,
    proves_instability as proves_instability,
    root_set as root_set,
)
from deadtime.roots._scalar_delay import dde_roots, rightmost_branches
from deadtime.roots._sensitivity import RootSensitivity
from deadtime.roots._text import latex as latex
from deadtime.roots.certificate import Certificate
from deadtime.roots.certificate._plots import plot_certificate as plot_certificate

__all__ = [
    "Certificate",
    "Chain",
    "Crossings",
    "Expansion",
    "Parameter",
    "ParametricQuasiPolynomial",
    "QuasiPolynomial",
    "RootSensitivity",
    "RootSet",
    "crossings",
    "dde_roots",
    "delay",
    "delay_margin",
    "parameters",
    "rightmost_branches",
    "s",
]
