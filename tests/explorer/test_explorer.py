"""What makes the explorer: from loops, maps, estimates and on the command line."""

from __future__ import annotations

import json
import webbrowser
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from command_line import run
from deadtime.loops._explored import described
from deadtime.tuning._live import live_design

LOOP = dtm.ControlLoop(dtm.Integrator(0.9, 0.1), dtm.PV(1.5, 0.13), delay=0.36, limit=1.0)


def given(page: str) -> dict[str, object]:
    """The state that a page shows first."""
    text = page.split('id="given">')[1].split("</script>")[0]
    state: dict[str, object] = json.loads(text)
    return state


def test_a_page_holds_everything_and_loads_nothing() -> None:
    page = LOOP.explore().html
    assert given(page)["lag"] == 0.1
    assert "{{" not in page.split("<script>")[0]
    for outside in ("http://", "https://", " src=", "import("):
        body = page.replace("http://www.w3.org/2000/svg", "")
        assert outside not in body.split('id="kernels">')[0]
    rest = page.split('id="kernels">')[0] + page.split('id="kernels">')[1].split("</script>", 1)[1]
    assert len(rest) < 100_000  # rust/web/make.py bounds the kernels


def test_a_title_is_text() -> None:
    explorer = dtm.loops.Explorer({"delay": 0.3}, title="</title><script>alert(1)</script>")
    assert "<script>alert" not in explorer.html
    hostile = dtm.loops.Explorer({"plant": "</script><script>alert(1)</script>"})
    assert "<script>alert" not in hostile.html


def test_a_notebook_shows_the_page() -> None:
    shown = LOOP.explore()._repr_html_()
    assert shown.startswith("<iframe")
    assert "&lt;!doctype html&gt;" in shown


def test_show_opens_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address))
    place = LOOP.explore().show()
    assert opened == [place.as_uri()]
    assert given(place.read_text(encoding="utf-8"))["delay"] == 0.36
    place.unlink()


def test_a_map_opens_with_its_axes_and_numbers() -> None:
    chart = dtm.stability_map(
        LOOP, {"Kp": (0, 4, 5), "delay": (0, 1, 6)}, at={"Kv": 0.2}, abscissa=False
    )
    state = chart.explore().state
    assert (state["x"], state["x_range"], state["y"], state["y_range"]) == (
        "Kp",
        [0.0, 4.0],
        "delay",
        [0.0, 1.0],
    )
    assert state["Kv"] == 0.2
    family = dtm.stability_map(
        dtm.s + (dtm.parameters("Kp Kv")[0] + dtm.parameters("Kp Kv")[1] * dtm.s) * dtm.delay(0.3),
        {"Kp": (0, 4, 5), "Kv": (0, 1, 6)},
        abscissa=False,
    )
    with pytest.raises(ValueError, match="another family"):
        family.explore()


def test_loops_that_the_page_does_not_know_are_refused_by_name() -> None:
    G = 1 / (dtm.s + dtm.delay(0.1))
    inside = dtm.ControlLoop(G, dtm.P(0.5), delay=0.1)
    with pytest.raises(ValueError, match="PlantWithDelays"):
        inside.explore()
    smooth = dtm.DerivativeFilter(20.0, discretisation="tustin")
    sampled = dtm.ControlLoop(
        dtm.Integrator(), dtm.PV(1.0, 0.1, smooth), delay=0.1, sample_time=0.05
    )
    with pytest.raises(ValueError, match="discretisation"):
        sampled.explore()
    with pytest.raises(ValueError, match="delay"):
        dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0)).explore()


def test_a_rational_plant_keeps_its_gain_apart() -> None:
    loop = dtm.ControlLoop(
        dtm.RationalPlant([2.0], [1.0, 3.0, 0.0], gain=0.5), dtm.P(1.0), delay=0.1
    )
    state = described(loop.specification)
    assert (state["gain"], state["num"], state["den"]) == (0.5, [2.0], [1.0, 3.0, 0.0])


def test_limits_weight_and_anti_windup_are_described() -> None:
    guarded = dtm.PI(1.0, 0.5, weight=0.4, anti_windup=2.0)
    loop = dtm.ControlLoop(dtm.Integrator(), guarded, delay=0.1, limit=(-0.5, 2.0))
    state = described(loop.specification)
    assert (state["low"], state["limit"], state["weight"]) == (-0.5, 2.0, 0.4)
    assert (state["guard"], state["tracking_time"]) == ("tracking", 2.0)
    stops = dtm.PI(1.0, 0.5, anti_windup=dtm.loops.ConditionalIntegration())
    state = described(loop.replace(controller=stops, limit=1.0).specification)
    assert (state["guard"], state["limit"]) == ("stops", 1.0)
    assert "low" not in state
    for other in (
        loop.replace(rate_limit=1.0),
        loop.replace(controller=dtm.PID(1.0, 0.5, 0.1, derivative_weight=0.5)),
        loop.replace(controller=dtm.PI(1.0, 0.5, feed_forward=0.5)),
    ):
        with pytest.raises(ValueError, match="the explorer cannot show a rate limit"):
            other.explore()
    with pytest.raises(ValueError, match="two finite limits"):
        loop.replace(limit=(-1.0, np.inf)).explore()


def test_a_plant_of_factors_with_one_lag_has_its_slider() -> None:
    factors = dtm.FactoredPlant([0.2], gain=0.9, integrator=True)
    state = described(dtm.ControlLoop(factors, dtm.P(1.0), delay=0.1).specification)
    assert (state["plant"], state["gain"], state["lag"]) == ("integrator", 0.9, 0.2)
    factors = dtm.FactoredPlant([0.2], gain=0.9)
    state = described(dtm.ControlLoop(factors, dtm.P(1.0), delay=0.1).specification)
    assert (state["plant"], state["gain"], state["lag"]) == ("first_order", 0.9, 0.2)
    factors = dtm.FactoredPlant([0.2], gain=0.9, zero=0.1)
    state = described(dtm.ControlLoop(factors, dtm.P(1.0), delay=0.1).specification)
    assert (state["plant"], state["num"]) == ("rational", [0.1, 1.0])


def test_a_design_opens_with_the_interval_of_its_delay_and_stands_in_reports() -> None:
    found = dtm.design(
        LOOP, controller=dtm.PV, delay=(0.3, 0.4), shape=(9, 9), objective="abscissa"
    )
    state = found.explore().state
    assert (state["Kp"], state["interval"]) == (found.gains["Kp"], [0.3, 0.4])
    shown = live_design(found)
    assert shown is not None
    assert shown.frame.startswith("<iframe")
    assert "<script" not in shown.frame
    G = 1 / (dtm.s + dtm.delay(0.1))
    inside = dtm.ControlLoop(G, dtm.P(0.5), delay=0.1)
    ranges = {"Kp": (0.1, 0.6)}
    assert (
        live_design(dtm.design(inside, controller=dtm.P, ranges=ranges, objective="abscissa"))
        is None
    )


def test_the_command_writes_the_page_of_a_loop_and_of_a_recording(tmp_path: Path) -> None:
    out = tmp_path / "pages" / "loop.html"
    done = run("explore", "--kp", "2", "--delay", "0.3", "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert given(out.read_text(encoding="utf-8"))["controller"] == "P"

    loop = dtm.ControlLoop(
        dtm.Integrator(0.85), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1.0
    )
    time = 0.065 * np.arange(130)
    reference = np.where(np.arange(130) < 10, 0.0, 1.0)
    noise = np.random.default_rng(4).normal(0.0, 0.005, 130)
    outputs = loop.simulate(time, reference).outputs + noise
    table = np.column_stack([time, reference, outputs])
    log = tmp_path / "step.csv"
    np.savetxt(log, table, delimiter=",", header="time,reference,output", comments="")
    done = run(
        *("explore", str(log), "--kp", "1.6", "--sample-time", "0.065", "--limit", "1"),
        *("--out", str(out), "--json"),
    )
    assert done.returncode == 0, done.stderr
    state = json.loads(done.stdout)["state"]
    low, high = state["interval"]
    assert low < 0.3 < high
    assert high - low < 0.03
    assert given(out.read_text(encoding="utf-8")) == state
