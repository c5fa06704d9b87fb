"""How well rows can tell a time: closed forms, and the scatter of right estimates."""

import numpy as np
import pytest
from deadtime.logs import Series, open_log, promises_of
from deadtime.logs.latencies import promised
from made_logs import copter, flown_copter
from scipy.ndimage import gaussian_filter1d


def jumps(rows, every, period=0.1):
    time = period * np.arange(rows)
    return Series(time, np.floor(time / every + 1e-9) % 2.0, "rad", "asked")


@pytest.mark.parametrize(("period", "hidden"), [(None, 0.1), (0.0025, 0.0975), (0.1, 0.0)])
def test_what_is_hidden_between_rows_is_that_of_a_uniform_time(period, hidden):
    asked = jumps(600, 2.0)
    came = Series(asked.time, np.roll(asked.values, 2), "rad", "came")
    found = promised(asked, came, [(0.0, 59.9)], period, longest=1.0)
    assert found.changes == pytest.approx(29.0)
    assert found.rows == pytest.approx(hidden / np.sqrt(12.0 * 29.0))


def test_unequal_changes_count_less():
    time = 0.1 * np.arange(100)
    values = np.cumsum(np.where(np.arange(100) % 20 == 10, [1.0] * 90 + [3.0] * 10, 0.0))
    came = Series(time, np.roll(values, 2), "rad", "came")
    found = promised(Series(time, values, "rad", "asked"), came, [(0.0, 9.9)], longest=1.0)
    squares = np.diff(values) ** 2
    assert found.changes == pytest.approx(squares.sum() ** 2 / (squares**2).sum())
    assert found.changes < np.count_nonzero(squares)


@pytest.mark.parametrize("drift", [0.0, 0.9])
def test_the_noise_part_is_the_scatter_of_least_squares(drift):
    row, count, delay = 0.02, 3000, 0.123
    fine = np.arange(0.0, row * (count + 20), 1e-3)
    shape = gaussian_filter1d(np.random.default_rng(1).standard_normal(fine.size), 60.0)
    shape /= shape.std()
    time = 0.2 + row * np.arange(count)
    asked = Series(time, np.interp(time, fine, shape), "rad", "asked")
    tried = np.linspace(delay - 0.02, delay + 0.02, 41)
    paths = np.stack([np.interp(time - one, fine, shape) for one in tried])

    def whitened(values):
        return values[..., 1:] - drift * values[..., :-1]

    promises, times = [], []
    for seed in range(60):
        random = np.random.default_rng(seed)
        noise = 0.3 * random.standard_normal(count)
        for k in range(1, count):
            noise[k] += drift * noise[k - 1]
        values = np.interp(time - delay, fine, shape) + noise
        found = promised(asked, Series(time, values, "rad", "came"), [(time[0], time[-1])],
                         row, longest=0.5)  # fmt: skip
        promises.append(found.stderr)
        left = whitened(values)
        both = whitened(paths)
        squares = np.sum(left**2) - (both @ left) ** 2 / np.sum(both**2, axis=1)
        best = np.polyfit(tried, squares, 2)
        times.append(-best[1] / (2.0 * best[0]))
    # What a few lags leave counts as noise: rather too large than too small.
    assert 0.8 < np.median(promises) / np.std(times) < 1.5


@pytest.mark.parametrize("factor", [0.05, 20.0])
def test_a_promise_scales_with_the_time(factor):
    random = np.random.default_rng(4)
    time = 0.02 * np.arange(2000)
    asked = np.repeat(random.standard_normal(40), 50)
    # Behind a lag of 0.2 s and 0.1 s of delay.
    came = np.zeros(2000)
    for k in range(6, 2000):
        came[k] = came[k - 1] + 0.1 * (asked[k - 6] - came[k - 1])
    came += 0.05 * random.standard_normal(2000)

    def promise(scale):
        asked_then = Series(scale * time, asked, "rad", "asked")
        came_then = Series(scale * time, came, "rad", "came")
        return promised(asked_then, came_then, [(0.0, 39.0 * scale)], longest=0.5 * scale)

    assert promise(factor).noise == pytest.approx(factor * promise(1.0).noise, rel=1e-3)


def test_nothing_is_promised_where_nothing_moves_or_follows():
    time = 0.02 * np.arange(2000)
    noise = np.random.default_rng(2).standard_normal(2000)
    rest = Series(time, np.zeros(2000), "rad", "asked")
    came = Series(time, noise, "rad", "came")
    assert np.isinf(promised(rest, came, [(0.0, 39.0)], longest=0.5).stderr)
    sticks = Series(time, np.repeat(np.random.default_rng(3).standard_normal(40), 50), "", "asked")
    found = promised(sticks, came, [(0.0, 39.0)], longest=0.5)
    assert np.isinf(found.noise)
    assert found.line().startswith("the response does not follow")


def test_each_followed_loop_of_a_log_has_a_promise(tmp_path):
    path = tmp_path / "flight.bin"
    path.write_bytes(flown_copter(seconds=20.0).data)
    log = open_log(path)
    (promise,) = promises_of(log).values()
    # The log holds every command of its controller: nothing is hidden between the rows.
    assert promise.rows == 0.0
    assert 1e-4 < promise.stderr < 5e-3
    assert "with these rows" in promise.line()
    path.write_bytes(copter().data)
    log = open_log(path)
    assert set(promises_of(log)) <= set(log.loops)
