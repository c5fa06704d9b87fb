"""Without an extra, functions that need it name the line that installs it; the others work."""

import json
import re
import sys
from functools import cache

import deadtime as dtm
import numpy as np
import pytest
from command_line import one_clear_line, run_elsewhere
from deadtime import Experiment
from deadtime.tuning import adaptive_gains
from made_processes import bump
from step_recordings import record_step

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.8, 0.1), delay=0.36, sample_time=0.065)
TIME = np.linspace(0.0, 5.0, 60)


def found_plant():
    time, command, output = bump(rows=150)
    return dtm.estimate_delay(dtm.Recording(time, None, output, command), plant="lag")


def estimated():
    return dtm.estimate_delay(*record_step(rest=1.0), free=("delay",))


def planned():
    return dtm.identifiability(LOOP, Experiment.step(1.0, 5.0), noise=0.01)


@cache
def tuned():
    return dtm.tune(found_plant(), controller=dtm.P)


def tracked():
    time = 0.065 * np.arange(12)
    return dtm.estimation.online(dtm.Recording(time, time, time, time), LOOP, noise=0.01)


def designed():
    return dtm.design(
        LOOP, ranges={"Kp": (0.5, 3), "Kv": (0, 0.5)}, shape=(5, 5), objective="abscissa"
    )


def filtered():
    return dtm.design_filter(LOOP, fixed={"Kp": 1.5}, omegas=[20.0, 40.0], loss=0.9)


def adapted():
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.1)
    return adaptive_gains(loop, (0.0, 0.2), sets=2)


def told():
    time = np.arange(200) * 0.02
    square = np.where(np.sin(3.7 * time) > 0.0, 1.0, -1.0)
    vehicle = dtm.FactoredPlant([0.1]).transfer_function() * dtm.delay(0.05)
    output = np.ravel(vehicle.simulate(time, square).outputs)
    output = output + 0.01 * np.random.default_rng(1).standard_normal(200)
    return dtm.latency(dtm.Recording(time, square, output))


SYSTEM = dtm.DelaySystem(A={0.0: -1.0, 0.3: -0.5}, B=1.0)
Kp, T = dtm.parameters("Kp T")
FAMILY = dtm.s + Kp * dtm.delay(T)
RANGES = {"Kp": (0.5, 3.0), "T": (0.1, 0.5)}
CONTINUOUS = LOOP.continuous()

#: Every drawing method of a public type.
DRAWN = {
    "Certificate.plot": lambda: (dtm.s + dtm.delay(1.0)).certify((-1, 1), (0, 9)).plot(),
    "ControlLoop.bode": CONTINUOUS.bode,
    "DelayEstimate.plot": lambda: estimated().plot(),
    "DelayTrack.plot": lambda: tracked().plot(),
    "Design.plot": lambda: designed().plot(),
    "FilterChoice.plot": lambda: filtered().plot(),
    "GainSchedule.plot": lambda: adapted().plot(),
    "Identifiability.plot": lambda: planned().plot(),
    "PlantEstimate.plot": lambda: found_plant().plot(),
    "Latency.plot": lambda: told().plot(),
    "Proposal.plot": lambda: tuned().plot(),
    "LoadResponse.plot": lambda: LOOP.load_response().plot(),
    "ProvedBoxes.plot": lambda: dtm.proved_boxes(FAMILY, RANGES, tol=0.3).plot(),
    "Response.plot": lambda: LOOP.step_response().plot(),
    "RobustMap.plot": lambda: dtm.robust_map(
        LOOP.continuous(), {"Kp": (0.5, 3), "Kv": (0, 0.5)}, {"delay": (0.3, 0.4)}, shape=(3, 3)
    ).plot(),
    "RootSet.plot": lambda: LOOP.rightmost().plot(),
    "StabilityMap.plot": lambda: dtm.stability_map(FAMILY, RANGES, shape=(3, 3)).plot(),
    "TransferFunction.bode": lambda: dtm.feedback(2.0 / dtm.s * dtm.delay(0.36)).bode(),
    "TransferFunction.nyquist": lambda: (2.0 / dtm.s * dtm.delay(0.36)).nyquist(),
}


def drawing_methods():
    """Every drawing method of the public types of all packages."""
    packages = (getattr(dtm, package) for package in dtm._PACKAGES if package != "_base.errors")
    for kind in (getattr(package, name) for package in packages for name in package.__all__):
        if isinstance(kind, type):
            for name in ("plot", "bode", "nyquist"):
                if callable(getattr(kind, name, None)):
                    yield f"{kind.__name__}.{name}"


def test_the_list_of_drawings_is_complete():
    assert set(drawing_methods()) == DRAWN.keys()


@pytest.mark.parametrize("name", DRAWN)
def test_drawing_without_matplotlib_says_which_line_installs_it(name, monkeypatch):
    # All but one raised a plain ModuleNotFoundError once.
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(dtm.MissingExtraError, match=r"pip install 'deadtime\[plot\]'") as raised:
        DRAWN[name]()
    assert isinstance(raised.value, ImportError)


def test_commands_that_draw_nothing_need_no_matplotlib(tmp_path):
    # The command once required matplotlib before it examined its options.
    commands = (
        "roots --kp 2 --delay 0.36 --json",
        "simulate --kp 2 --delay 0.36 --points 11 --json",
        "map --delay 0.36 --shape 3 3 --json",
    )
    for done in run_elsewhere(*map(str.split, commands), missing="matplotlib", cwd=tmp_path):
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)


def test_commands_that_draw_ask_for_it_before_they_work(tmp_path):
    commands = ("roots --kp 2 --delay 0.36 --plot a.png", "demo")
    for done in run_elsewhere(*map(str.split, commands), missing="matplotlib", cwd=tmp_path):
        assert "pip install 'deadtime[plot]'" in (said := one_clear_line(done))
        assert "\n" not in said
    assert not list(tmp_path.iterdir())


def test_pages_without_their_engine_say_which_line_installs_it(tmp_path):
    commands = (["demo"], ["explore", "--out", "page.html"])
    demo, explore = run_elsewhere(*commands, missing="jinja2", cwd=tmp_path)
    assert "pip install 'deadtime[cli]'" in (said := one_clear_line(demo))
    assert "\n" not in said
    assert explore.returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.parametrize(
    ("head", "library"),
    [(b"PAR1", "pyarrow"), (b"ARROW1\0\0", "pyarrow"), (b"MATLAB 7.3 MAT-file", "h5py")],
)
def test_reading_without_a_library_says_which_line_installs_it(
    head, library, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, library, None)
    path = tmp_path / "flight.csv"
    path.write_bytes(head + bytes(64))
    with pytest.raises(dtm.MissingExtraError, match=r"pip install 'deadtime\[logs\]'") as raised:
        dtm.read_recording(path)
    assert library in str(raised.value)


@pytest.mark.parametrize(
    ("task", "library", "installs"),
    [
        (lambda flight, folder: flight.save(folder / "a.parquet"), "pyarrow", "'deadtime[logs]'"),
        (lambda flight, _: flight.to_dataframe(), "pandas", "pandas"),
        (lambda flight, _: flight.to_xarray(), "xarray", "xarray"),
    ],
)
def test_handing_on_without_a_library_says_which_line_installs_it(
    task, library, installs, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, library, None)
    flight = record_step()[0]
    with pytest.raises(dtm.MissingExtraError, match=re.escape(f"pip install {installs}")):
        task(flight, tmp_path)
