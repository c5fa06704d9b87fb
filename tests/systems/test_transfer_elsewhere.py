"""Transfer functions of control loops, conversion to and from other packages, plots."""

import cmath
import importlib
import importlib.util
import math

import deadtime as dtm
import numpy as np
import pytest
from deadtime import (
    PD,
    PI,
    PID,
    ControlLoop,
    P,
    TransferFunction,
    delay,
    feedback,
    parameters,
    s,
)
from transfers import LOOPS

# Loops


@pytest.mark.parametrize(
    "controller",
    [
        dtm.P(2.0),
        dtm.PV(2.0, 0.3),
        dtm.PD(2.0, 0.3, filter=dtm.DerivativeFilter(38.0)),
        dtm.PI(2.0, 0.5),
        dtm.PID(2.0, 0.5, 0.1, filter=dtm.DerivativeFilter(20.0, 0.7)),
    ],
)
@pytest.mark.parametrize(
    "plant", [dtm.Integrator(0.9, 0.1), dtm.FirstOrder(1.2, 0.5), dtm.kit_plant()]
)
def test_the_loop_as_a_transfer_function(plant, controller):
    loop = dtm.ControlLoop(plant, controller, delay=0.1)
    L = loop.open_loop()
    z = np.array([0.3 + 1j, -0.5 + 4j, 2.0])
    parts = plant.transfer_function() * controller.transfer_function() * delay(0.1)
    np.testing.assert_allclose(L(z), parts(z), rtol=1e-13)
    np.testing.assert_allclose(feedback(L).den(z), loop.characteristic()(z), rtol=1e-13)
    assert repr(loop.margin()) == repr(L.margin())
    if loop.is_stable():
        more = loop.margin().delay_margin
        assert loop.stable_range("delay")[1] == pytest.approx(0.1 + more, rel=1e-8)


@pytest.mark.parametrize("path", ["command", "measurement"])
def test_the_closed_loop_is_the_transform_of_its_step_response(path):
    loop = dtm.ControlLoop(
        dtm.Integrator(), dtm.PV(2.0, 0.2, filter=dtm.DerivativeFilter(30.0)), delay=0.25,
        delay_path=path,
    )  # fmt: skip
    t = np.linspace(0, 40, 40001)
    y = loop.step_response(t).outputs
    for z in (1.0, 0.4, 2.0):
        from scipy.integrate import simpson

        transform = z * (simpson(y * np.exp(-z * t), x=t) + math.exp(-40 * z) / z)
        assert loop.closed_loop()(z).real == pytest.approx(transform, rel=1e-7)
    assert loop.closed_loop().dcgain() == pytest.approx(1.0)


def test_sampled_loops_have_no_transfer_function():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
    for ask in (loop.open_loop, loop.closed_loop):
        with pytest.raises(ValueError, match=r"sample_time=0.065 .* continuous\(\)"):
            ask()
    # Margins of a sampled loop are its own: the hold costs delay.
    assert loop.continuous().margin().delay_margin > loop.margin().delay_margin
    with pytest.raises(ValueError, match="delay of this loop is None"):
        loop.replace(delay=None).continuous().margin()


# Other packages

needs_control = pytest.mark.skipif(
    importlib.util.find_spec("control") is None, reason="python-control is not installed"
)
RATIONAL = [
    ([2.0], [1.0, 0.0]),
    ([1.5, 1.5], [1.0, 0.5, 9.0, 0.0]),
    ([1.0, -3.0, 2.0], [1.0, 4.0, 6.0, 4.0]),
    ([10.0], [1.0, 3.0, 3.0, 1.0]),
    ([6.0], [1.0, 3.0, 2.0, 0.0]),
    ([0.5, 1.0], [1.0, 2.0]),
    ([4.0], [1.0, -1.0]),
]


@needs_control
@pytest.mark.parametrize(("num", "den"), RATIONAL)
def test_python_control_agrees_without_delay(num, den):
    import control

    theirs = control.tf(num, den)
    ours = TransferFunction(num, den)
    assert TransferFunction(theirs) == ours
    omega = np.geomspace(0.01, 100, 50)
    np.testing.assert_allclose(ours.frequency_response(omega), theirs(1j * omega), rtol=1e-12)
    both = feedback(ours), control.feedback(theirs)
    ours_all = np.append(both[0].poles(), both[0].hidden_modes())
    for mine, other in ((ours_all, both[1].poles()), (ours.zeros(), theirs.zeros())):
        np.testing.assert_allclose(np.sort_complex(mine), np.sort_complex(other), atol=1e-6)
    assert both[0].is_stable() == bool(np.all(both[1].poles().real < 0))
    found = ours.margin()
    gm, pm, _, wpc, wgc, _ = control.stability_margins(theirs, returnall=True)
    np.testing.assert_allclose(np.sort(found.gain_crossovers), np.sort(wgc), rtol=1e-7)
    inner = np.argsort(wpc)
    if found.stable:
        np.testing.assert_allclose(found.phase_crossovers, wpc[inner], rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(found.gain_margins, gm[inner], rtol=1e-6)
        if len(pm):
            assert found.phase_margin == pytest.approx(np.min(np.abs(pm)), rel=1e-6)
    _, phase, _ = control.frequency_response(theirs, omega)
    turns = (ours.phase(omega) - np.unwrap(phase)) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns[0]), atol=1e-9)


@needs_control
def test_python_control_both_ways():
    import control

    theirs = control.ss([[0.0, 1.0], [-4.0, -0.4]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    G = TransferFunction(theirs, delay=0.36)
    z = 0.3 + 2j
    assert G(z) == pytest.approx(complex(theirs(z)) * cmath.exp(-0.36 * z), rel=1e-12)
    back = TransferFunction([1.0, 2.0], [3.0, 4.0]).to_control()
    assert isinstance(back, control.TransferFunction)
    assert complex(back(z)) == pytest.approx((z + 2) / (3 * z + 4))
    with pytest.raises(ValueError, match="pade=n"):
        G.to_control()
    rough = G.to_control(pade=4)
    assert complex(rough(1j)) == pytest.approx(G(1j), rel=1e-9)
    num, den = control.pade(0.36, 4)
    assert complex(rough(20j)) == pytest.approx(complex((theirs * control.tf(num, den))(20j)))
    T = feedback(2 / s * delay(0.36) + delay(0.7) / s)
    assert complex(T.to_control(pade=5)(1j)) == pytest.approx(T(1j), rel=1e-8)
    for bad, message in (
        (control.tf([1.0], [1.0, 1.0], 0.1), "dt=0.1"),
        (control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "2 inputs"),
    ):
        with pytest.raises(ValueError, match=message):
            TransferFunction(bad)
    with pytest.raises(ValueError, match="delay"):
        TransferFunction(theirs, delay=-1.0)


def test_scipy_both_ways():
    from scipy import signal

    for system in (
        signal.lti([2.0], [1.0, 3.0]),
        signal.ZerosPolesGain([], [-3.0], 2.0),
        signal.StateSpace([[-3.0]], [[1.0]], [[2.0]], [[0.0]]),
    ):
        G = TransferFunction(system, delay=0.1)
        assert G(1.0) == pytest.approx(0.5 * math.exp(-0.1))
    back = TransferFunction([2.0], [1.0, 3.0]).to_scipy()
    assert isinstance(back, signal.TransferFunction)
    assert back.freqresp([1.0])[1][0] == pytest.approx(2 / (3 + 1j))
    rough = (2.0 / (s + 3) * delay(0.1)).to_scipy(pade=3)
    assert rough.freqresp([1.0])[1][0] == pytest.approx(2 / (3 + 1j) * cmath.exp(-0.1j), rel=1e-9)
    with pytest.raises(ValueError, match=r"dt=0\.1"):
        TransferFunction(signal.dlti([1.0], [1.0, 0.5], dt=0.1))
    with pytest.raises(ValueError, match="2 outputs"):
        TransferFunction(signal.StateSpace([[-1.0]], [[1.0]], [[1.0], [2.0]], [[0.0], [0.0]]))
    for order in (0, 21):
        with pytest.raises(ValueError, match=f"pade={order}"):
            (1 / s * delay(0.1)).to_scipy(pade=order)


@needs_control
def test_systems_of_other_packages_take_part_in_algebra():
    import control
    from scipy import signal

    G = 1.8 / (40.0 * s + 1.0)
    for theirs in (control.tf([1.8], [40.0, 1.0]), control.ss([[-0.025]], [[0.045]], [[1]], [[0]])):
        for one in (theirs * delay(12.0), delay(12.0) * theirs, theirs * (delay(12.0) / 1.0)):
            assert one(0.1j) == pytest.approx((G * delay(12.0))(0.1j), rel=1e-14)
        for one, other in ((theirs + s, G + s), (s - theirs, s - G), (s / theirs, s / G)):
            assert one(0.1j) == pytest.approx(other(0.1j), rel=1e-14)
        assert feedback(G, theirs)(1j) == pytest.approx(feedback(G, G)(1j), rel=1e-14)
    one = signal.lti([1.8], [40.0, 1.0]) * delay(12.0)
    assert one(0.1j) == pytest.approx((G * delay(12.0))(0.1j), rel=1e-14)


@pytest.mark.parametrize(
    ("written", "spelled"),
    [
        (lambda: np.exp(-12 * s), r"exp\(-12 s\) is written deadtime\.delay\(12\)"),
        (lambda: math.exp(-0.5 * s), r"deadtime\.delay\(0\.5\)"),
        (lambda: math.e ** (-3 * s), r"deadtime\.delay\(3\)"),
        (lambda: np.exp(3 * s), r"deadtime\.delay\(T\)"),
        (lambda: np.exp(-s * (s + 1)), r"deadtime\.delay\(T\)"),
        (lambda: np.exp(-s * parameters("T")[0]), r"deadtime\.delay\(T\)"),
        (lambda: np.exp(-1 / s), r"deadtime\.delay\(T\)"),
        (lambda: np.sin(s), r"numpy\.sin does not work on a QuasiPolynomial"),
        (lambda: np.array([1.0, 2.0]) * s, r"numpy\.multiply does not work on a QuasiPolynomial"),
    ],
)
def test_a_delay_in_another_spelling_is_answered_with_the_right_one(written, spelled):
    with pytest.raises(TypeError, match=spelled):
        written()


def test_numbers_of_numpy_stay_numbers():
    two = np.float64(2.0)
    assert two * s == 2.0 * s
    assert s * two == 2.0 * s
    assert two + s == 2.0 + s
    assert two - s == 2.0 - s
    assert two / s == 2.0 / s
    assert np.array(2.0) * s == 2.0 * s
    assert (two == s) is False
    assert (two != s) is True


@needs_control
def test_a_system_of_another_package_as_a_controller():
    import control
    from scipy import signal

    plant = 1.8 / (40.0 * s + 1.0) * delay(12.0)
    for given, expected in (
        (control.tf([2.0], [1.0]), P(2.0)),
        (control.tf([2.0, 0.5], [1.0, 0.0]), PI(2.0, 0.5)),
        (control.tf([4.0, 2.0, 0.5], [2.0, 0.0]), PID(1.0, 0.25, 2.0)),
        (signal.lti([2.0, 0.5], [1.0, 0.0]), PI(2.0, 0.5)),
        (2.0 + 0.5 / s, PI(2.0, 0.5)),
        (2.0 + 0.5 * s, PD(2.0, 0.5)),
    ):
        assert ControlLoop(plant, given).controller == expected
    for bad in (1.0 / (s + 1.0), delay(1.0), (2.0 + 0.5 / s) * delay(1.0), 1.0 / s**2):
        with pytest.raises(ValueError, match=r"deadtime\.feedback\(C \* G\)"):
            ControlLoop(plant, bad)
    with pytest.raises(TypeError, match="controller=3"):
        ControlLoop(plant, 3.0)


@pytest.mark.parametrize("name", ["bode", "margin", "nyquist", "pade", "step_response", "tf"])
def test_names_of_other_packages_say_what_to_write(name):
    with pytest.raises(AttributeError, match=f"no attribute '{name}': write "):
        getattr(dtm, name)
    assert not hasattr(dtm, "no_such_name")


def test_all_poles_of_an_infinite_spectrum_name_the_rightmost():
    with pytest.raises(ValueError, match=r"rightmost\(n\)"):
        feedback(1.8 / (40.0 * s + 1.0) * delay(12.0)).poles()


def test_without_python_control_it_says_what_to_install(monkeypatch):
    def absent(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", absent)
    with pytest.raises(ImportError, match="pip install control"):
        (1 / s).to_control()


# Pictures


@pytest.fixture
def pyplot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


@pytest.mark.parametrize("G", [LOOPS[0], LOOPS[2], 9.0 / s * delay(0.36), TransferFunction(2.0)])
def test_pictures_are_labelled(pyplot, G):
    upper, lower = G.bode(margins=True)
    assert upper.get_ylabel() == "gain"
    assert lower.get_ylabel() == "phase / °"
    assert lower.get_xlabel() == "frequency / (rad/s)"
    ax = G.nyquist(margins=True)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Re G(jω)", "Im G(jω)")
    assert "-1" in [line.get_label() for line in ax.get_lines()]
    stable = G.margin().stable
    assert ("delay margin" in ax.get_title()) == stable
    assert ("not stable" in ax.get_title()) == (not stable)
    ax.figure.canvas.draw()
    upper.figure.canvas.draw()


def test_plots_use_the_axes_that_are_given(pyplot):
    _, axes = pyplot.subplots(2, 1)
    assert TransferFunction(s * delay(0.1)).bode([0.1, 1.0, 10.0], ax=axes) is axes
    _, ax = pyplot.subplots()
    assert (1 / (s + 1)).nyquist([0.1, 1.0], ax=ax) is ax
    with pytest.raises(ValueError, match="ax has 1"):
        (1 / s).bode(ax=[ax])
