"""Progress is True for a bar, or a function of the number of items done, in every package."""

import sys

import deadtime as dtm
import pytest
from deadtime import paper
from deadtime._base.progress import reported

Kp, Kv, T = dtm.parameters("Kp Kv T")
OVER = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(T)
H = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
RANGES = {"Kp": (0.1, 6), "Kv": (-0.9, 0.9)}

LONG = {
    "map": lambda p: dtm.stability_map(H, RANGES, (5, 4), progress=p),
    "robust map": lambda p: dtm.robust_map(
        OVER, {"Kp": (1, 2), "Kv": (0, 0.1)}, {"T": (0.3, 0.4)}, (3, 2), progress=p
    ),
    "boxes": lambda p: dtm.proved_boxes(H, RANGES, 0.2, progress=p),
    "box": lambda p: dtm.largest_stable_box(H, RANGES, tol=0.1, progress=p),
    "sweep": lambda p: dtm.sweep(LOOP, {"Kp": (0.5, 2.0, 9)}, 5.0, progress=p),
}


@pytest.mark.parametrize("ask", LONG.values(), ids=LONG)
def test_a_bar_or_a_function(ask, capsys, monkeypatch):
    for name in ("rich", "tqdm"):
        monkeypatch.setitem(sys.modules, name, None)
    plain, shown = ask(False), ask(True)
    assert plain == shown
    told = []
    ask(told.append)
    assert all(isinstance(one, int) for one in told)
    assert capsys.readouterr().out == ""
    with pytest.raises(TypeError, match="True for a bar"):
        ask("loud")


def test_lines_on_stderr_are_few(capsys, monkeypatch):
    for name in ("rich", "tqdm"):
        monkeypatch.setitem(sys.modules, name, None)
    with reported(True, 1000) as report:
        for done in range(1, 1001):
            report(done)
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "1000 of 1000 done"
    assert len(lines) <= 12
    with reported(True) as report:
        for done in range(1, 1001):
            report(done)
    assert len(capsys.readouterr().err.splitlines()) <= 12


def test_a_bar_of_rich_is_on_stderr(capsys):
    pytest.importorskip("rich")
    with reported(True, 10) as report:
        report(10)
    assert capsys.readouterr().out == ""


def test_stages_are_printed_or_given_to_a_function(capsys):
    names = []
    paper.reproduce(["gap"], progress=names.append)
    assert len(names) == 1
    paper.reproduce(["gap"], progress=True)
    assert capsys.readouterr().err == f"{names[0]}\n"
    paper.reproduce(["gap"])
    assert capsys.readouterr().err == ""
    with pytest.raises(TypeError, match="True to print the stages"):
        paper.reproduce(["gap"], progress="loud")
