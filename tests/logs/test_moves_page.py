"""The picture of all moves on the page of a log, and real flights against their known times."""

import deadtime as dtm
import numpy as np
import pytest
from browser import check_page
from deadtime._base.page import page, write_page
from deadtime.logs.latencies import aligned, differences, modelled, moves_of, plain_times
from deadtime.logs.latencies._commands import sampling_of
from deadtime.logs.latencies._page import fit_of, moves_of_page
from flights import flight_path
from made_logs import flown_copter

#: Of the made flight, s.
SECONDS = 20.0


def followed(log, name):
    loop = log.loop(name)
    return loop, sampling_of(log, loop.kind, loop.setpoint).between


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A made flight: its fit from the setpoint, its moves, and those of the fit."""
    pytest.importorskip("matplotlib", reason="matplotlib draws the pictures")
    path = tmp_path_factory.mktemp("log") / "flight.bin"
    path.write_bytes(flown_copter(seconds=SECONDS).data)
    log = dtm.open_log(path)
    one = dtm.latency(log).loop("roll rate")
    loop, between = followed(log, "roll rate")
    signals = loop.setpoint, loop.response
    moves = moves_of(*signals, loop.segments, longest=0.8, between=between)
    fit = modelled(one.estimate.plant, one.estimate.delay, *signals, loop.segments, between)
    return one, moves, aligned(moves.moves, loop.setpoint, fit, between=between)


def test_the_fit_of_a_vehicle_answers_to_its_moves_as_the_vehicle_does(made):
    _, moves, fitted = made
    assert moves.count == pytest.approx(2 * (SECONDS - 1.0) / 1.1, abs=3)
    low, high = moves.interval
    assert low - 0.001 < fitted.median < high + 0.001
    known = np.isfinite(moves.response) & np.isfinite(fitted.response)
    assert np.max(np.abs(moves.response - fitted.response)[known]) < 0.05


def test_the_picture_shows_the_responses_and_marks_both_times(made):
    from deadtime.logs.latencies._plots import DRAWN, plot_moves

    _, moves, fitted = made
    (ax,) = plot_moves(moves, fitted.median, fitted.response).axes
    labels = [line.get_label() for line in ax.get_lines()]
    both = [f"response {moves.shown(moves.median)}", f"fit {moves.shown(fitted.median)}"]
    for named in ("setpoint", *both):
        assert any(label.startswith(named) for label in labels), labels
    thin = [line for line in ax.get_lines() if line.get_linewidth() == 0.5]
    assert 0.5 * DRAWN < len(thin) <= DRAWN
    marks = [line for line in ax.get_lines() if line.get_marker() == "o"]
    factor = ax.get_lines()[0].get_xdata()[-1] / moves.time[-1]
    at = [float(line.get_xdata()[0]) for line in marks]
    assert at == pytest.approx([moves.median * factor, fitted.median * factor], rel=1e-2)
    alone = plot_moves(moves).axes[0]
    assert not any(line.get_label().startswith("fit") for line in alone.get_lines())


def test_a_loop_without_moves_has_no_picture_but_words(made):
    from deadtime.logs.latencies._plots import plot_moves

    _, moves, _ = made
    none = aligned([], None, None)
    assert moves_of_page(none)["figure"] is None
    assert "never moves" in moves_of_page(none)["caption"]
    assert moves_of_page(moves)["figure"] is not None
    with pytest.raises(ValueError, match="nothing to draw"):
        plot_moves(none)


def test_the_page_reads_the_number_first_and_fits_a_phone(made, tmp_path):
    one, moves, fitted = made
    fit = fit_of(one, moves, fitted)
    text = page(
        "logs/latencies/page.html", title="Latencies", described="a vehicle", verdict="",
        heads=[], rows=[], below=[], all=None, budget=[], filters=[], link="", fits=[fit],
        refused=[], remarks=[], around=None,
    )  # fmt: skip
    number = text.index('<p class="number">')
    assert text.index("<h2>Roll rate") < number < text.index("moves-0-caption")
    assert fit["number"] in text
    assert "the fit, at the same rows" in text
    check_page(write_page(text, tmp_path / "page.html"))


#: File, loop, and the time of independent fits of delay and lag together, s.
FLOWN = [
    ("copter_2015_83.bin", "roll", 0.133),
    ("copter_2015_83.bin", "pitch", 0.10),
    ("copter_rate_24hz_truth_62.5ms.bin", "roll rate", 0.0625),
]


@pytest.mark.parametrize(("name", "loop", "time"), FLOWN)
def test_plain_numbers_of_real_flights_lie_below_delay_and_lag(name, loop, time):
    log = dtm.open_log(flight_path(name))
    one, between = followed(log, loop)
    found = plain_times(
        one.setpoint, one.response, one.segments,
        longest=0.8 if one.kind == "rate" else 1.6, between=between,
    )  # fmt: skip
    for plain in found.all:
        low, high = plain.interval
        assert low < time + 0.005, plain.line()
        # Delay and 0.69 lag, which is at least that share of both.
        assert high > 0.69 * time, plain.line()
    assert found.aligned.count > 10


def test_a_racer_at_a_thousand_rows_a_second():
    pyulog = pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    data = {
        one.name: one.data
        for one in pyulog.ULog(str(flight_path("px4_s250_gyro_only.ulg"))).data_list
    }
    first = data["vehicle_rates_setpoint"]["timestamp"][0]

    def series(topic, column):
        time = (data[topic]["timestamp"] - first) * 1e-6
        kept = np.concatenate([[True], np.diff(time) > 0.0])
        return dtm.logs.Series(time[kept], data[topic][column][kept].astype(float), "rad/s", column)

    for setpoint, gyro in (("roll", "x"), ("pitch", "y")):
        asked, came = series("vehicle_rates_setpoint", setpoint), series("sensor_gyro", gyro)
        found = plain_times(asked, came, [(5.0, 40.0)], longest=0.4, between="straight")
        # 41 to 47 ms by independent cross-correlation, 42.5 ms by least squares.
        assert 0.040 < found.correlation.value < 0.048
        assert found.correlation.quality > 0.9
        low, high = found.moves.interval
        assert low < 0.045 < high + 0.005


def test_a_fit_of_a_real_flight_agrees_with_its_plain_numbers():
    log = dtm.open_log(flight_path("copter_2015_83.bin"))
    estimate = dtm.latency(log, loops=["pitch"]).loop("pitch").estimate
    one, between = followed(log, "pitch")
    given = {"longest": 1.6, "between": between}
    signals = one.setpoint, one.response
    fit = modelled(estimate.plant, estimate.delay, *signals, one.segments, between)
    measured = plain_times(*signals, one.segments, **given)
    beside = plain_times(one.setpoint, fit, one.segments, **given, moves=measured.aligned.moves)
    found = differences(measured, beside)
    assert len(found) == 3
    assert not any(one.disagrees for one in found)
