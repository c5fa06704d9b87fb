"""The explorer in a real browser: Chromium, driven by Playwright."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np
import pytest
from browser import check_tab, chromium
from web_kernels import recorded_step

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.5, 0.13), delay=0.36, limit=1.0)
RANGES = {"Kp": (0.0, 6.0), "Kv": (-0.9, 0.9)}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    return LOOP.explore(RANGES).save(tmp_path_factory.mktemp("page") / "loop.html").as_uri()


class Page:
    """An open explorer, offline."""

    def __init__(self, browser: Any, address: str, **context: Any) -> None:
        self.context = browser.new_context(offline=True, accept_downloads=True, **context)
        self.tab = self.context.new_page()
        self.said: list[str] = []
        self.tab.on("console", lambda message: self.said.append(message.text))
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.goto(address)
        self.tab.wait_for_selector("body[data-ready=yes]")

    @property
    def drawn(self) -> dict[str, Any]:
        """What the page shows, after the next frame."""
        self.tab.evaluate("() => new Promise((done) => requestAnimationFrame(() => done()))")
        shown: dict[str, Any] = self.tab.evaluate("() => window.drawn")
        return shown

    def choose(self, list_of: str, option: str) -> None:
        """Choose in a list. The sliders of another loop are there after the next frame."""
        self.tab.select_option(list_of, option)
        assert self.drawn

    def close(self) -> None:
        self.context.close()
        assert self.said == []


@pytest.fixture
def page(browser: Any, address: str) -> Iterator[Page]:
    opened = Page(browser, address)
    yield opened
    opened.close()


def cells(tab: Any) -> np.ndarray:
    """Colours of the cells, first axis to the right and second one up."""
    flat, size = tab.evaluate(
        "() => { const c = document.getElementById('cells');"
        " return [[...c.getContext('2d').getImageData(0, 0, c.width, c.height).data],"
        " [c.height, c.width]]; }"
    )
    return np.array(flat).reshape(*size, 4)[::-1, :, :3].transpose(1, 0, 2)


def are_stable(tab: Any, place: tuple[int, int]) -> np.ndarray:
    """Cells of the colour of one that is stable."""
    colours = cells(tab)
    return np.asarray(np.all(colours == colours[place], axis=2))


def test_the_page_shows_what_python_computes(page: Page) -> None:
    drawn = page.drawn
    assert drawn["numbers"]["abscissa"] == pytest.approx(LOOP.spectral_abscissa(), rel=1e-12)
    assert drawn["numbers"]["margins"]["gain"] == pytest.approx(LOOP.margin().gain_margin)
    chart = dtm.stability_map(LOOP, RANGES, shape=(300, 300), abscissa=False)
    assert drawn["stable"] == pytest.approx(chart.stable.mean(), abs=1e-12)
    assert np.array_equal(are_stable(page.tab, (60, 150)), chart.stable)
    assert page.tab.inner_text("#verdict") == "Stable"


def test_a_slider_moves_everything(page: Page) -> None:
    before = page.drawn
    page.tab.focus("#range-delay")
    for _ in range(5):
        page.tab.keyboard.press("Shift+ArrowRight")
    drawn = page.drawn
    delay = drawn["state"]["delay"]
    # The slider goes to three times the delay.
    assert delay == pytest.approx(0.36 + 5 * 0.1 * 1.08)
    loop = LOOP.replace(delay=delay)
    assert drawn["numbers"]["abscissa"] == pytest.approx(loop.spectral_abscissa(), rel=1e-9)
    assert drawn["stable"] < before["stable"]
    page.tab.fill("#number-sample_time", "0.065")
    page.tab.keyboard.press("Enter")
    sampled = page.drawn
    known = loop.replace(sample_time=0.065).spectral_abscissa()
    assert sampled["numbers"]["abscissa"] == pytest.approx(known, rel=1e-9)
    assert "sampled" in page.tab.inner_text("#margins")
    held = loop.replace(sample_time=0.065)
    chart = dtm.stability_map(held, RANGES, shape=(150, 150), abscissa=False)
    assert np.array_equal(are_stable(page.tab, (20, 75)), chart.stable)


@pytest.mark.survey
def test_the_point_is_dragged_and_moved_by_keys(page: Page) -> None:
    box = page.tab.locator("#map .frame").bounding_box()
    page.tab.mouse.move(box["x"] + 5, box["y"] + box["height"] / 2)
    page.tab.mouse.down()
    page.tab.mouse.move(box["x"] + 0.99 * box["width"], box["y"] + box["height"] / 2, steps=4)
    page.tab.mouse.up()
    state = page.drawn["state"]
    assert state["Kp"] == pytest.approx(5.94, abs=0.03)
    assert state["Kv"] == pytest.approx(0.0, abs=0.02)
    assert page.tab.inner_text("#verdict") == "Unstable"
    page.tab.focus("#map")
    page.tab.keyboard.press("ArrowLeft")
    assert page.drawn["state"]["Kp"] == pytest.approx(state["Kp"] - 0.06)


@pytest.mark.survey
def test_a_copied_address_shows_the_same_view(page: Page, browser: Any) -> None:
    page.choose("#controller", "PI")
    page.tab.fill("#number-gain", "0.7")
    page.tab.keyboard.press("Enter")
    state = page.drawn["state"]
    assert (state["controller"], state["gain"], state["y"]) == ("PI", 0.7, "Ki")
    page.tab.wait_for_function("() => location.hash.includes('gain')")
    other = Page(browser, page.tab.url)
    assert other.drawn["state"] == state
    other.close()


@pytest.mark.survey
@pytest.mark.parametrize("broken", ["#delay=%7B", "#delay=-1e999&Kp", "#x=%22nothing%22&num=3"])
def test_a_broken_address_is_left_out(browser: Any, address: str, broken: str) -> None:
    opened = Page(browser, address + broken)
    assert opened.drawn["state"]["delay"] == 0.36
    assert opened.tab.inner_text("#problem") == ""
    opened.close()


@pytest.mark.survey
@pytest.mark.long
def test_every_plant_controller_and_axis_can_be_shown(page: Page) -> None:
    for plant in ("integrator", "first_order", "rational"):
        page.tab.select_option("#plant", plant)
        for controller in ("P", "PI", "PD", "PV", "PID"):
            page.tab.select_option("#controller", controller)
            assert page.drawn["state"]["plant"] == plant
            axes = page.tab.evaluate("() => [...document.getElementById('axis-y').options].length")
            for i in range(axes):
                page.tab.select_option("#axis-y", index=i)
                assert "proved" in page.tab.inner_text("#timing")
                assert page.drawn["state"]["controller"] == controller
                assert page.tab.inner_text("#problem") == "", page.drawn["state"]


@pytest.mark.survey
def test_a_plant_becomes_its_polynomials(page: Page) -> None:
    page.tab.fill("#number-lag", "0.2")
    page.tab.keyboard.press("Enter")
    before = page.drawn["numbers"]["abscissa"]
    page.tab.select_option("#plant", "rational")
    drawn = page.drawn
    assert drawn["state"]["den"] == [0.2, 1, 0]
    assert drawn["numbers"]["abscissa"] == pytest.approx(before, rel=1e-12)


@pytest.mark.survey
def test_what_is_saved_can_be_read(page: Page, tmp_path: Path) -> None:
    saved = {}
    for name in ("json", "svg", "png"):
        with page.tab.expect_download() as waiting:
            page.tab.click(f"#{name}")
        saved[name] = tmp_path / waiting.value.suggested_filename
        waiting.value.save_as(saved[name])
    found = json.loads(saved["json"].read_text())
    assert found["schema"] == "deadtime.explorer/1"
    assert found["state"]["delay"] == 0.36
    for x, y, omega in found["curves"][0][0]:
        member = LOOP.replace(Kp=x, Kv=y)
        assert abs(member.characteristic()(1j * omega)) < 1e-8 * (1.0 + omega)
    assert "<image" in saved["svg"].read_text()
    assert saved["png"].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("width", "scheme"),
    [
        (360, "dark"),
        *(
            pytest.param(*one, marks=[pytest.mark.survey, pytest.mark.long])
            for one in [(360, "light"), (900, "light"), (900, "dark"), (1300, "dark")]
        ),
        pytest.param(1300, "light", marks=pytest.mark.survey),
    ],
)
def test_no_serious_finding_of_axe_and_nothing_cut_off(
    browser: Any, address: str, scheme: str, width: int
) -> None:
    size = {"width": width, "height": 900}
    opened = Page(browser, address, viewport=size, color_scheme=scheme, reduced_motion="reduce")
    check_tab(opened.tab, width)
    opened.close()


@pytest.mark.survey
def test_a_page_in_a_frame_works(browser: Any, tmp_path: Path) -> None:
    place = tmp_path / "report.html"
    text = (
        f"<!doctype html><html lang='en'><title>Report</title>{LOOP.explore(RANGES).frame}</html>"
    )
    place.write_text(text, encoding="utf-8")
    tab = browser.new_page()
    said: list[str] = []
    tab.on("console", lambda message: said.append(message.text))
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.goto(place.as_uri())
    frame = tab.frame_locator("iframe")
    frame.locator("body[data-ready=yes]").wait_for()
    frame.locator("#number-delay").fill("0.9")
    frame.locator("#number-delay").press("Enter")
    tab.wait_for_timeout(400)
    assert frame.locator("#verdict").inner_text() == "Stable"
    inner = "() => [document.documentElement.scrollHeight, document.documentElement.clientHeight]"
    whole, seen = tab.frames[1].evaluate(inner)
    assert whole <= seen
    frame.locator("#suggest").click()
    frame.locator("#suggestion", has_text="gain margin").wait_for()
    assert said == []
    tab.close()


CSV = {
    "comma": ("time,reference,output\n", ",", "."),
    "semicolons and decimal commas": ("Time (s);SP;PV\n", ";", ","),
}


@pytest.mark.parametrize(
    "form",
    [form if form == "comma" else pytest.param(form, marks=pytest.mark.survey) for form in CSV],
)
def test_a_dropped_recording_is_fitted_in_the_page(page: Page, tmp_path: Path, form: str) -> None:
    recording, loop, delay = recorded_step(2, 0.0, 0.0)
    columns = (recording.time, recording.reference, recording.output)
    head, separator, point = CSV[form]
    rows = [
        separator.join(f"{value:.6f}".replace(".", point) for value in row)
        for row in zip(*columns, strict=True)
    ]
    log = tmp_path / "step.csv"
    log.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")
    page.tab.set_input_files("#file", log)
    page.tab.wait_for_function("() => document.getElementById('estimate').textContent")
    # Velocity feedback needs the command; under P it follows from the rows.
    assert "choose the column of the command" in page.tab.inner_text("#estimate")
    page.choose("#controller", "P")
    for name in ("Kp", "sample_time", "limit"):
        page.tab.fill(f"#number-{name}", f"{loop.parameters[name]:.9f}")
        page.tab.keyboard.press("Enter")
    page.tab.click("#fit")
    page.tab.wait_for_function("() => window.drawn.state.interval")
    state = page.drawn["state"]
    known = dtm.estimate_delay(recording, loop, free=("delay", "gain"))
    assert state["interval"] == pytest.approx(known.ci(), abs=1e-3)
    assert known.ci()[0] < delay < known.ci()[1]
    assert state["delay"] == pytest.approx(known.delay, abs=2e-4)
    assert state["gain"] == pytest.approx(known.gain, abs=1e-3)
    assert "The model explains the recording" in page.tab.inner_text("#estimate")
    assert page.tab.locator("#recorded circle").count() == 130
    assert page.tab.locator("#recorded").is_visible()
    page.tab.select_option("#axis-y", "delay")
    assert page.drawn["state"]["y"] == "delay"
    assert page.tab.locator("#map .end").count() == 2
    # Ranges, sample time and the time of the step are those of the file.
    largest = loop.continuous().replace(delay=known.delay, gain=known.gain).margin().gain_margin
    assert state["ranges"]["delay"] == pytest.approx([0.0, 3.0 * state["delay"]], rel=0.01)
    most = 1.2 * largest * loop.parameters["Kp"]
    assert state["ranges"]["Kp"] == pytest.approx([0.0, most], rel=0.01)
    assert state["sample_time"] == pytest.approx(0.065)
    assert page.tab.get_attribute("#range-delay", "max") == str(state["ranges"]["delay"][1])
    assert state["Kp"] == pytest.approx(loop.parameters["Kp"])


@pytest.mark.survey
def test_a_fit_that_is_not_reliable_is_not_taken_over(page: Page, tmp_path: Path) -> None:
    recording, loop, _ = recorded_step(0, 0.15, 0.0)
    columns = (recording.time, recording.reference, recording.output, recording.command)
    log = tmp_path / "lagging.csv"
    head = "time,reference,output,command"
    np.savetxt(log, np.column_stack(columns), delimiter=",", header=head, comments="")
    before = page.drawn["state"]
    page.tab.set_input_files("#file", log)
    page.tab.wait_for_function("() => document.getElementById('estimate').textContent")
    assert "does not explain the recording" in page.tab.inner_text("#estimate")
    assert page.drawn["state"] == before
    page.tab.check("#fit-lag")
    page.tab.click("#fit")
    page.tab.wait_for_function("() => window.drawn.state.interval")
    # The commands are those of a P controller.
    state = page.drawn["state"]
    assert state["controller"] == "P"
    assert state["Kp"] == pytest.approx(loop.parameters["Kp"], rel=1e-4)
    assert state["limit"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "heads",
    [
        ["t", "SP", "PV", "OP"],
        pytest.param(["T", "t", "r", "y", "u"], marks=pytest.mark.survey),
        pytest.param(["Elapsed [min]", "sec", "desired", "pv (degC)"], marks=pytest.mark.survey),
        pytest.param(["DateTime", "ref_m", "height_m", "cmd"], marks=pytest.mark.survey),
    ],
)
def test_columns_are_guessed_as_by_the_reader(page: Page, tmp_path: Path, heads: list[str]) -> None:
    from deadtime.recordings.readers._usual import chosen_columns

    signals = ("time", "reference", "output", "command")
    known = chosen_columns("", heads, dict.fromkeys(signals), {"command"})
    log = tmp_path / "named.csv"
    # Too few rows for a fit.
    stamps = [f"2024-05-01T10:00:0{k}.250Z" for k in range(5)]
    cell = {known["time"]: stamps if heads[0] == "DateTime" else range(5)}
    rows = [[str(cell.get(head, [0] * 5)[k]) for head in heads] for k in range(5)]
    log.write_text("\n".join(map(",".join, [heads, *rows])) + "\n", encoding="utf-8")
    page.tab.set_input_files("#file", log)
    page.tab.wait_for_function("() => document.getElementById('estimate').textContent")
    chosen = {signal: page.tab.input_value(f"#column-{signal}") for signal in signals}
    assert {signal: name for signal, name in chosen.items() if name} == known
    assert "5 rows" in page.tab.inner_text("#estimate")


def test_a_fit_leaves_the_page_alive_and_can_be_cancelled(page: Page, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    time = 0.02 * np.arange(2500)
    command = np.repeat(rng.choice([-1.0, 1.0], 100), 25)
    loop = dtm.ControlLoop(dtm.Integrator(0.9, 0.2), dtm.P(1e-9), delay=0.3, sample_time=0.02)
    output = loop.simulate(time, 0.0 * time, load=command).outputs + rng.normal(0.0, 0.02, 2500)
    log = tmp_path / "long.csv"
    table = np.column_stack([time, 0.0 * time, output, command])
    head = "t,r,y,u"
    np.savetxt(log, table, delimiter=",", header=head, comments="")
    before = page.drawn["state"]
    page.tab.set_input_files("#file", log)
    page.tab.wait_for_selector("#working:not([hidden])")
    page.tab.fill("#number-Kp", "1.1")
    page.tab.keyboard.press("Enter")
    assert page.drawn["state"]["Kp"] == 1.1
    assert page.tab.locator("#working").is_visible()
    page.tab.click("#cancel")
    page.tab.wait_for_selector("#working", state="hidden")
    assert "Cancelled" in page.tab.inner_text("#estimate")
    assert page.drawn["state"] == before | {"Kp": 1.1}


def test_suggested_gains_are_those_of_the_package(page: Page) -> None:
    page.tab.click("#suggest")
    page.tab.wait_for_function("() => document.getElementById('suggestion').textContent")
    state = page.drawn["state"]
    known = dtm.design(LOOP)
    for name, value in known.gains.items():
        assert state[name] == pytest.approx(value, rel=1e-6)
    assert "Ms 1.6" in page.tab.inner_text("#suggestion")
    margin = f"gain margin {known.margins.gain_margin:.3g}"
    assert margin in page.tab.inner_text("#suggestion")


def test_what_a_loop_meets_acts_in_the_step(page: Page, tmp_path: Path) -> None:
    page.choose("#controller", "PI")
    for name, value in (("weight", "0.5"), ("load", "0.25"), ("Ki", "0.5"), ("limit", "0.75")):
        page.tab.fill(f"#number-{name}", value)
        page.tab.keyboard.press("Enter")
    page.tab.check("#unequal")
    page.choose("#guard", "tracking")
    for name, value in (("low", "-0.125"), ("tracking_time", "2")):
        page.tab.fill(f"#number-{name}", value)
        page.tab.keyboard.press("Enter")
    assert page.drawn["state"]["guard"] == "tracking"
    with page.tab.expect_download() as waiting:
        page.tab.click("#json")
    waiting.value.save_as(tmp_path / "loop.json")
    found = json.loads((tmp_path / "loop.json").read_text())["response"]
    time = np.array(found["time"])
    controller = dtm.PI(1.5, 0.5, weight=0.5, anti_windup=2.0)
    loop = LOOP.replace(controller=controller, limit=(-0.125, 0.75))
    load = np.where(time >= time[-1] / 2.0, 0.25, 0.0)
    known = loop.simulate(time, np.ones(time.size), load=load)
    np.testing.assert_allclose(found["commands"], known.inputs, atol=1e-9)
    assert known.inputs.max() == 0.75
    assert known.inputs.min() == -0.125


def test_the_roots_fill_their_picture(page: Page) -> None:
    """The rightmost two are not drawn on one line by a chain far away."""
    places = page.tab.evaluate(
        "() => [...document.querySelectorAll('#roots .roots path')].map((one) =>"
        " one.getAttribute('d').match(/^M([-\\d.]+) ([-\\d.]+)/).slice(1).map(Number))"
    )
    box = page.tab.evaluate("() => document.getElementById('roots').viewBox.baseVal.height")
    first, second = places[0][1], places[1][1]
    assert abs(first - second) > 0.1 * box


def test_map_margins_step_and_roots_stand_above_the_fold(browser: Any, address: str) -> None:
    opened = Page(browser, address, viewport={"width": 1440, "height": 900})
    for name in ("map", "margins", "steps", "roots"):
        box = opened.tab.locator(f"#{name}").bounding_box()
        assert box["y"] + box["height"] <= 900.0, name
        assert box["x"] + box["width"] <= 1440.0, name
    opened.close()


@pytest.mark.survey
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,reference,output\n0,0,0\n", "no rows"),
        ("time\n0\n1\n2\n", "one column"),
        ("time,reference,output\n" + "0,0,0\n" * 20, "times must increase"),
        ("time,reference,output\n0,0\n1,1\n", "2 cells"),
    ],
)
def test_a_file_without_sense_is_refused_in_words(
    page: Page, tmp_path: Path, text: str, said: str
) -> None:
    log = tmp_path / "bad.csv"
    log.write_text(text, encoding="utf-8")
    page.tab.set_input_files("#file", log)
    page.tab.wait_for_function("() => document.getElementById('estimate').textContent")
    assert said in page.tab.inner_text("#estimate")


@pytest.mark.survey
def test_an_interval_of_the_delay_is_a_band(browser: Any, tmp_path: Path) -> None:
    from deadtime.loops._explored import explorer_of

    place = explorer_of(LOOP.specification, RANGES, (0.3, 0.42)).save(tmp_path / "band.html")
    opened = Page(browser, place.as_uri())
    drawn = opened.drawn
    charts = [
        dtm.stability_map(LOOP.replace(delay=late), RANGES, shape=(150, 150), abscissa=False)
        for late in np.linspace(0.3, 0.42, 5)
    ]
    stable = np.all([chart.stable for chart in charts], axis=0)
    assert drawn["stable"] == pytest.approx(stable.mean(), abs=1e-12)
    opened.tab.click("#drop-interval")
    assert opened.drawn["stable"] > drawn["stable"]
    opened.close()
