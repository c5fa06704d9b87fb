"""Equations with numbers many decades apart, and edges beside clusters, against ball arithmetic.

Each was refused once although ball arithmetic decides it.
"""

import deadtime as dtm
import pytest
from ball_survey import Package, examine
from deadtime import delay, s
from hard_functions import hard_function

# Coefficients up to 1e227: real or complex roots as far out as 1e69 lead; a neutral equation whose
# leading root lies at 5e10 beside chains at 0.01.
LEADING_FAR_OUT = (1726, 3246, 3259, 4827, 5768, 7674)

# Four roots within 1e-4 of each other, an edge through their midst or right beside them.
BESIDE_CLUSTERS = (3538, 3677, 5265)


@pytest.mark.parametrize("number", LEADING_FAR_OUT)
def test_a_root_far_out_is_found(number):
    case = hard_function(1, number)
    found = dtm.QuasiPolynomial(case.coefficients, case.delays).rightmost()
    assert len(found) in (1, 2)
    assert abs(found[0]) > 1e5


# Those for which balls take no more than a moment.
@pytest.mark.parametrize("number", [1726, 5768, 7674])
def test_the_rightmost_root_far_out(number):
    case = hard_function(1, number)
    verdicts, _ = examine(case, Package())
    # Balls leave some of these undecided in the pieces they are given.
    assert verdicts["rightmost"] in ("equal", "unknown")
    assert not any(verdict.startswith("wrong") for verdict in verdicts.values())


@pytest.mark.parametrize("number", BESIDE_CLUSTERS)
def test_counts_beside_clusters(number):
    verdicts, _ = examine(hard_function(1, number), Package())
    assert verdicts["count"] == verdicts["sum of roots"] == verdicts["discs"] == "equal"


def test_half_planes_of_stiff_equations_are_counted():
    """The line to be counted is 1e25 high, and one row dominates on all of it."""
    h = s**2 + 2.6e25 * s + 1e50 + 3.0 * s * delay(20.0)
    assert [h.count(re=(sigma, None)) for sigma in (0.0, -1.0)] == [0, 0]


@pytest.mark.survey
def test_roots_that_no_line_separates_are_refused_with_the_reason():
    """Along a chain of millions of roots, |s + 1e8 e^(−1e-8 s)| is equal to 15 digits."""
    h = s + 1e8 * delay(1e-8) + delay(1.0)
    with pytest.raises(ValueError, match="differ too much for double precision"):
        h.rightmost()
