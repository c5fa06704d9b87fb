"""What a notebook shows of results, and the version."""

import base64
import sys
from importlib.metadata import version

import deadtime as dtm
import pytest
from deadtime import delay, s
from matplotlib import pyplot
from step_recordings import record_step

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


def test_margins_are_a_table_in_markdown():
    margins = (2.0 / s * delay(0.36)).margin()._repr_markdown_()
    assert "| delay | 0.425398 s | 2 |" in margins.splitlines()
    assert (9.0 / s * delay(0.36)).margin()._repr_markdown_() is None


LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.8, 0.1), delay=0.36, sample_time=0.065)

#: What a notebook shows by a picture, and words of the text below.
PICTURED = {
    "Certificate": (lambda: (s + delay(1.0)).certify((-1, 1), (0, 9)), "1 root"),
    "ControlLoop": (lambda: LOOP, "PV(Kp=1.8"),
    "DelayEstimate": (
        lambda: dtm.estimate_delay(*record_step(rest=1.0), free=("delay",)),
        "reliable: delay",
    ),
    "Design": (
        lambda: dtm.design(
            LOOP, ranges={"Kp": (0.5, 3), "Kv": (0, 0.5)}, shape=(5, 5), objective="abscissa"
        ),
        "least margins",
    ),
    "Identifiability": (
        lambda: dtm.identifiability(LOOP, dtm.Experiment.step(1.0, 5.0), noise=0.01),
        "delay",
    ),
    "Response": (LOOP.step_response, "&lt;Response: 1 output at"),
    "RootSet": (lambda: (s + delay(1.0)).roots(re=(-8, 2), im=(0, 200)), "RootSet: 32 roots"),
    "StabilityMap": (
        lambda: dtm.stability_map(s + Kp * delay(tau_d), {"Kp": (0.1, 6), "tau_d": (0, 1)}, (5, 4)),
        "of 20 stable",
    ),
}


@pytest.mark.parametrize("name", PICTURED)
def test_results_are_shown_by_a_picture_and_their_text(name, monkeypatch):
    make, words = PICTURED[name]
    result, windows = make(), pyplot.get_fignums()
    shown = result._repr_html_()
    data = base64.b64decode(shown.split("base64,")[1].split('"')[0])
    assert data.startswith(b"\x89PNG")
    assert words in shown
    assert len(shown) < 200_000
    # A window of pyplot would show the picture twice.
    assert pyplot.get_fignums() == windows
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert result._repr_html_() is None


@pytest.mark.parametrize(
    "loop",
    [
        LOOP.replace(delay=None),
        # No step response of its own length, an impulse in it, and one that overflows.
        dtm.ControlLoop(dtm.RateLimited(dtm.Integrator(), 1.0), dtm.P(1.0), delay=0.3),
        dtm.ControlLoop(1 / (s + delay(0.1)), dtm.PD(1.0, 0.1), delay=0.3),
        dtm.ControlLoop(dtm.RationalPlant([1.0], [1.0, -1.0]), dtm.P(50.0), delay=0.3, limit=1.0),
    ],
)
def test_a_loop_without_a_step_response_is_shown_as_text(loop):
    with pytest.raises(ValueError, match=r"."):
        loop.step_response()
    assert loop._repr_html_() is None


def test_the_version_is_that_of_the_installed_package():
    assert dtm.__version__ == version("deadtime")
