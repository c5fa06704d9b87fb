"""Recordings whose commands were sent at times of their own, between the rows."""

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, strategies as st
from marks import NIGHTLY

#: Rows of a simulated flight.
ROWS = 300

TIME = np.linspace(0.0, 1.9, 20)
SENT = (np.array([-0.5, 0.33, 0.34, 1.2, 5.0]), np.array([0.0, 1.0, 2.0, -1.0, 3.0]))


def recording(sent=SENT, **more):
    return dtm.Recording(TIME, np.zeros(20), TIME**2, sent=sent, **more)


def test_each_row_has_the_last_command_sent():
    found = recording()
    last = [max((t, u) for t, u in zip(*SENT, strict=True) if t <= row)[1] for row in TIME]
    assert found.command.tolist() == last
    assert found.sent.time.tolist() == SENT[0].tolist()
    assert not found.command.flags.writeable
    assert not found.sent.values.flags.writeable


def test_a_window_keeps_the_commands_before_it():
    found = recording().window(1.0, 1.9)
    assert found.sent.time.tolist() == [-0.5, 0.33, 0.34, 1.2]
    assert found.command[0] == 2.0
    assert found.window(1.0, 1.9) == found


@pytest.mark.parametrize("rate_of_rate", [None, 5.0])
def test_commands_behind_limits_are_those_of_a_limited_plant(rate_of_rate):
    plant = dtm.RateLimited(dtm.Integrator(), 1.5, rate_of_rate)
    held = dtm.Recording(TIME, np.zeros(20), TIME**2, np.sin(TIME))
    for one, sent in ((recording(), SENT), (held, (TIME, np.sin(TIME)))):
        found = one.behind_limits(1.5, rate_of_rate)
        time, command = plant.limited(*sent)
        assert found.sent.time.tolist() == time.tolist()
        assert found.sent.values.tolist() == command.tolist()
        assert found.output.tolist() == one.output.tolist()


def test_limits_need_a_command_and_are_above_zero():
    with pytest.raises(dtm.RecordingError, match="no command"):
        dtm.Recording(TIME, np.zeros(20), TIME**2).behind_limits(1.0)
    with pytest.raises(ValueError, match="rate=0: give a finite number above zero"):
        recording().behind_limits(0.0)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_it_is_saved_bit_for_bit(tmp_path, ending):
    if ending == ".parquet":
        pytest.importorskip("pyarrow", reason="pyarrow writes Parquet files")
    found = recording(units={"output": "m"}, source="flight")
    found.save(tmp_path / f"run{ending}")
    assert dtm.Recording.load(tmp_path / f"run{ending}") == found


@pytest.mark.parametrize(
    ("sent", "match"),
    [
        (([0.1], [1.0]), "the first command is sent at 0.1 s, after the first row at 0 s"),
        (([-1.0, -1.0], [1.0, 2.0]), "at row 1 the time of the commands repeats"),
        (([-1.0, 0.0], [1.0]), "1 commands were sent at 2 times"),
        (([-1.0], [np.nan]), "the commands is nan at row 0"),
        (([], []), "0 samples, but at least 1"),
    ],
)
def test_what_is_wrong_is_said(sent, match):
    with pytest.raises(dtm.RecordingError, match=match):
        recording(sent)


def test_the_sample_time_is_held_against_the_times_of_the_commands():
    # Rows every 40 ms of commands every 65 ms: on the rows, changes are 40 or 80 ms apart.
    time, sent = np.arange(0.0, 8.0, 0.04), np.arange(-0.5, 8.0, 0.065)
    values = np.sin(sent)
    found = dtm.Recording(time, np.zeros_like(time), np.cos(time), sent=(sent, values))

    def refusals(sample_time):
        loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=sample_time)
        return [one.message for one in found.check(loop).findings if one.severity == "refused"]

    assert refusals(0.065) == []
    assert any("100 % of the changes of the command follow" in one for one in refusals(0.1))


def test_a_command_and_sent_ones_exclude_each_other():
    with pytest.raises(TypeError, match="give only one of the two"):
        recording(command=np.zeros(20))


def flight(seed, integrates):
    """A vehicle of one lag told at 50 Hz and logged at 150 Hz with scattered times, in closed form.

    Between commands u the velocity v decays to u; a plant that integrates moves by its integral.
    """
    random = np.random.default_rng(seed)
    delay, lag = random.uniform(0.004, 0.03), random.uniform(0.02, 0.06)
    told = np.arange(-25, 200) * 0.02
    square = np.sign(np.sin(2.0 * np.pi * told / 0.9 + 0.3)) * (told > 0.0)
    value = square * np.repeat(random.uniform(0.5, 1.0, 9), 25)
    time = np.cumsum(0.0067 * (1.0 + 0.3 * random.uniform(-1.0, 1.0, ROWS)))
    output, arrived = np.empty(ROWS), told + delay
    v, x, now, held, k = 0.0, 0.0, arrived[0], 0.0, 0
    for row, at in enumerate(time):
        while True:
            until = min(at, arrived[k] if k < told.size else np.inf)
            decay = np.exp(-(until - now) / lag)
            x += held * (until - now) + (v - held) * lag * (1.0 - decay)
            v, now = held + (v - held) * decay, until
            if until == at:
                break
            held, k = value[k], k + 1
        output[row] = x if integrates else v
    output += (0.002 if integrates else 0.02) * random.standard_normal(ROWS)
    return (told, value), time, output, delay, lag


@pytest.mark.parametrize("integrates", [True, False])
def test_the_times_of_commands_are_those_of_the_estimate(integrates):
    errors, covered = [], 0
    for seed in range(1):
        sent, time, output, delay, lag = flight(seed, integrates)
        told = dtm.Recording(time, np.zeros(time.size), output, sent=sent)
        loop = dtm.ControlLoop(dtm.FactoredPlant([0.04], integrator=integrates), dtm.P(1.0))
        fit = dtm.estimate_delay(told, loop, free=["delay", "gain", "lag_1"])
        errors.append((fit.delay_plus_lag - delay - lag) / fit.stderr["delay+lag"])
        low, high = fit.ci(0.95, "delay+lag")
        covered += low < delay + lag < high
        assert fit.stderr["delay+lag"] < 1.5e-3  # less than a fourth of the time between rows
    assert covered >= 1
    assert np.all(np.abs(errors) < 4.0)


@given(cut=st.floats(0.0, 1.2))
def test_any_window_has_the_commands_of_the_whole(cut):
    whole = recording()
    part = whole.window(cut, None)
    assert part.command.tolist() == whole.command[whole.rows(cut, None)].tolist()


SAMPLE = 0.065


def flown(seed):
    """Two steps of a P loop whose height is read in steps of 1 mm: its numbers, rows, commands."""
    random = np.random.default_rng(seed)
    delay, gain, lag = random.uniform([0.2, 0.7, 0.08], [0.4, 1.0, 0.2])
    loop = dtm.ControlLoop(
        dtm.Integrator(gain, lag), dtm.P(1.6), delay=delay, sample_time=SAMPLE, limit=1.0
    )
    time = SAMPLE * np.arange(150)
    reference = np.where(time < 1.5, 0.0, np.where(time < 5.5, 1.0, 0.4))
    noise = random.normal(0.0, 0.002, time.size)
    # Later rows do not move earlier ones: after as many rounds as rows all are rounded.
    for _ in range(time.size):
        run = loop.simulate(time, reference - noise, reference_time=time, initial_output=0.0)
        rounded = 1e-3 * np.round(1e3 * (run.outputs + noise)) - run.outputs
        if np.allclose(rounded, noise, rtol=0.0, atol=1e-12):
            break
        noise = rounded
    return loop, time, reference, run.outputs + noise, run.inputs


def estimated(seeds, kept):
    """Error of delay + lag, s; how many fits are reliable, hold it, tell of lost commands."""
    errors, reliable, held, known = [], 0, 0, 0
    for seed in range(seeds):
        loop, time, reference, output, command = flown(seed)
        rows = kept(seed, reference, command)
        told = dtm.Recording(time, reference, output, sent=(time[rows], command[rows]))
        fit = dtm.estimate_delay(told, loop.replace(delay=None), free=["delay", "gain", "lag"])
        low, high = fit.ci(0.95, "delay+lag")
        late = loop.delay + loop.plant.lag
        errors.append(fit.delay_plus_lag - late)
        reliable += fit.verdict == "reliable"
        held += fit.verdict == "reliable" and low < late < high
        known += "assumed to be lost" in fit.message
    return np.sqrt(np.mean(np.square(errors))), reliable, held, known


@pytest.mark.parametrize(("flights", "misses"), [(4, 1), pytest.param(20, 4, marks=NIGHTLY)])
def test_commands_that_are_logged_when_they_change_hold_until_the_next(flights, misses):
    # A rounded height gives the same command again and again.
    def kept(seed, reference, command):
        return np.append(True, np.abs(np.diff(command)) > 1e-12)

    error, reliable, held, known = estimated(flights, kept)
    assert known == 0
    assert error < 0.001  # 0.7 ms, and 7 where those left out count as lost
    assert reliable >= flights - misses
    assert held >= reliable - misses


@pytest.mark.parametrize(("flights", "misses"), [(3, 1), pytest.param(12, 3, marks=NIGHTLY)])
def test_commands_that_the_log_has_lost_at_a_step_are_unknown(flights, misses):
    def kept(seed, reference, command):
        rows = np.random.default_rng(100 + seed).uniform(size=command.size) > 0.1
        rows[np.flatnonzero(np.diff(reference)) + 1] = False
        return rows | (np.arange(command.size) == 0)

    error, reliable, held, known = estimated(flights, kept)
    assert known == flights
    assert error < 0.005  # 3.5 ms, and 8 where each is the mean of those around it
    assert reliable >= flights - misses
    assert held >= reliable - misses
