"""Numbers with the digits that their errors leave."""

import pytest
from deadtime._base.digits import between, rounded, shown, stated
from hypothesis import given, strategies as st


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (0.00342, 0.00005, "s", "3.42 ± 0.05 ms"),
        (0.4302, 0.0151, "s", "430 ± 15 ms"),
        (1.0, 0.0299, "", "1.00 ± 0.03"),
        (0.999, 0.0951, "", "1.00 ± 0.10"),
        (12345.6, 2100.0, "", "12300 ± 2100"),
        (0.0, 0.0, "s", "0 ms"),
        (2.0, float("nan"), "m", "2 m"),
        (1.5, 0.2, "s", "1.50 ± 0.20 s"),
    ],
)
def test_numbers_have_the_digits_of_their_error(value, error, unit, text):
    assert stated(value, error, unit) == text


def test_errors_of_rounding_are_not_shown():
    assert stated(0.1, 1e-16, "s") == "100 ms"
    assert shown(0.1, 1e-16, "s") == "100 ms"
    assert shown(0.10012, 3e-4, "s") == "100.1 ms"
    assert between(0.1, 0.1 + 1e-16, 1e-16, "s") == "100 to 100 ms"
    assert stated(0.1, 1e-9, "s") == "100.0000000 ± 0.0000010 ms"


def test_ends_of_an_interval_have_them_too():
    assert between(0.003312, 0.003529, 0.00005, "s") == "3.31 to 3.53 ms"
    assert between(0.0, 0.0, 0.0, "s") == "0 to 0 ms"


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e6))
def test_what_is_left_out_is_less_than_the_error(value, error):
    assert abs(float(rounded(value, error)) - value) <= 0.25 * error + 1e-11
