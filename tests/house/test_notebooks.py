"""What a notebook shows of results, and the version."""

from importlib.metadata import version

import deadtime as dtm
import pytest
from deadtime import delay, s

Kp, tau_d = dtm.parameters("Kp tau_d")


@pytest.mark.parametrize(
    ("shown", "text"),
    [
        (s + (2 + 0.3 * s) * delay(0.36), r"s + \left(2 + 0.3 s\right) e^{-0.36 s}"),
        (s**12 - 1e-7 * delay(0.5), r"s^{12} - 1 \cdot 10^{-7} e^{-0.5 s}"),
        (
            s + Kp * delay(2 * tau_d + 0.1),
            r"s + \mathrm{Kp} e^{-\left(2 \mathrm{tau\_d} + 0.1\right) s}",
        ),
        (2.0 / s * delay(0.36), r"\frac{2 e^{-0.36 s}}{s}"),
    ],
)
def test_formulas_in_latex(shown, text):
    assert shown._repr_latex_() == f"${text}$"


def test_tables_in_html():
    roots = (s + delay(1.0)).roots(re=(-8, 2), im=(0, 200))._repr_html_()
    assert "32 roots in re=(-8, 2), im=(0, 200), 12 of 32 shown" in roots
    assert roots.count("<tr>") == 13
    margins = (2.0 / s * delay(0.36)).margin()._repr_html_()
    assert "<td>delay</td><td>0.425398 s</td><td>2</td>" in margins
    assert "not stable" in (9.0 / s * delay(0.36)).margin()._repr_html_()
    (Kv,) = dtm.parameters("Kv")
    h = s + (Kp + Kv * s) * delay(0.36)
    chart = dtm.stability_map(h, {"Kp": (0.1, 6), "Kv": (-1.2, 0.9)}, (5, 4), abscissa=False)
    assert "<td>infinitely many</td><td>5</td>" in chart._repr_html_()


def test_the_version_is_that_of_the_installed_package():
    assert dtm.__version__ == version("deadtime")
