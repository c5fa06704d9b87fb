"""The telemetry link of a tlog, on packets with known transport, drift and loss."""

import deadtime as dtm
import numpy as np
import pytest
from command_line import found, run
from deadtime.logs._link import half_round_trip, lost_packets, transport_of
from hypothesis import given, strategies as st
from made_logs import Tlog

#: Truth: least transport each way, s, mean of what is added, drift of the ground's clock, loss.
LEAST, ADDED, DRIFT, LOSS = 0.020, 0.008, 1e-4, 0.05


def made(seconds=60.0, seed=1, timesync=True, drift=DRIFT, target=False):
    """A tlog at 50 Hz, its transport above the least, and how many packets were lost."""
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    random = np.random.default_rng(seed)
    log, ground = Tlog(), Tlog(system=255, component=190)
    m = log.dialect
    packets, added, lost = [], [], 0

    def clock(vehicle):
        return 1.7e9 + (1.0 + drift) * vehicle

    def sent(sender, at, message, number=None):
        if number is not None:
            sender.link.seq = number % 256
        sender.data = b""
        sender.add(at, message)
        packets.append((at, sender.data))

    for number in range(round(50 * seconds)):
        boot = 10.0 + 0.02 * number
        wait = random.exponential(ADDED)
        arrives = clock(boot + LEAST + wait)
        message = m.MAVLink_attitude_message(round(1e3 * boot), 0.1, 0, 0, 0, 0, 0)
        if number % 50 == 0:
            message = m.MAVLink_heartbeat_message(2, 3, 128 | 1, 4, 4, 3)
        elif timesync and number % 25 == 7:
            # Asked as long ago as both ways take.
            asked = clock(boot - LEAST - random.exponential(ADDED))
            stamp = 1000 + number
            sent(ground, asked, m.MAVLink_timesync_message(0, stamp))
            message = m.MAVLink_timesync_message(round(1e9 * boot), stamp)
        elif random.uniform() < LOSS:
            lost += 1
            continue
        else:
            added.append(wait)
        if target and number % 10 == 0:
            wanted = (0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            sent(ground, clock(boot), m.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, 1, 0x0DC7, *wanted))  # fmt: skip
        sent(log, arrives, message, number)
    if target:
        at = clock(boot + 1.0)
        for k in range(100):
            ned = m.MAVLink_local_position_ned_message(round(1e3 * boot) + 20 * k, 0, 0, 0, 0, 0, 1)
            sent(log, at + 0.02 * k, ned, number + 1 + k)
    packets.sort(key=lambda one: one[0])
    return b"".join(data for _, data in packets), np.array(added), lost


@pytest.fixture
def opened(tmp_path):
    def write(data):
        path = tmp_path / "flight.tlog"
        path.write_bytes(data)
        return dtm.open_log(path)

    return write


@pytest.mark.parametrize("drift", [DRIFT, -DRIFT])
def test_transport_drift_and_loss_are_those_of_the_packets(opened, drift):
    data, added, lost = made(drift=drift)
    link = opened(data).link
    assert (link.message, link.count) == ("ATTITUDE", added.size)
    # The least of so many is at most a millisecond above none; stamps are whole milliseconds.
    assert link.median == pytest.approx(np.median(added), abs=1.5e-3)
    assert link.quantile_95 == pytest.approx(np.quantile(added, 0.95), abs=1.5e-3)
    assert link.drift == pytest.approx(drift, abs=2e-5)
    # Half a round trip is at least the least transport, and near it where waits are short.
    assert LEAST < link.half_round_trip < LEAST + 0.5 * ADDED
    assert link.round_trips == 120
    assert link.lost == lost
    assert link.loss == pytest.approx(LOSS, abs=0.02)


def test_without_timesync_only_what_varies_is_known(opened):
    log = opened(made(timesync=False)[0])
    assert log.link.half_round_trip is None
    assert "above the shortest time" in log.link.summary()
    assert "Without TIMESYNC the shortest time is not known" in log.summary()
    assert log.to_dict()["link"]["half_round_trip"] is None


def test_the_report_has_the_link(opened, tmp_path):
    log = opened(made(target=True)[0])
    assert "vertical speed" in log.loops
    found = dtm.latency(log, loops=("vertical speed",))
    text = found.details()
    assert log.link.summary() in text
    assert "has the time at which the ground sent it" in text
    assert found.to_dict()["link"]["lost"] == log.link.lost
    page = found.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<h2>The link</h2>" in page
    assert "half of the shortest round trip" in page


def test_inspect_tells_it(opened, tmp_path):
    data, _, lost = made()
    path = tmp_path / "a.tlog"
    path.write_bytes(data)
    assert found("inspect", path)["link"]["lost"] == lost
    assert "half of the shortest round trip" in " ".join(run("inspect", path).stdout.split())


def test_a_short_log_and_other_formats_have_none(opened):
    assert opened(made(seconds=1.5)[0]).link is None


@given(st.integers(0, 2**32 - 1))
def test_the_line_below_is_that_of_linear_programming(seed):
    from scipy.optimize import linprog

    random = np.random.default_rng(seed)
    v = np.sort(np.round(random.uniform(0.0, 50.0, 80), 2))
    g = 5.0 + (1.0 + 3e-4 * random.standard_normal()) * v + random.exponential(0.01, 80)
    transport, drift = transport_of(v, g)
    # The largest mean of a + b v with a + b v <= g - v (Moon, Skelly and Towsley 1999).
    least = linprog(
        [-1.0, -v.mean()], A_ub=np.stack([np.ones(80), v], axis=1), b_ub=g - v, bounds=(None, None)
    )
    assert transport.min() == pytest.approx(0.0, abs=1e-9)
    assert np.mean(transport) == pytest.approx(np.mean(g - v) + least.fun, abs=1e-7)
    assert np.all(transport >= -1e-12)
    assert drift == pytest.approx(least.x[1], abs=1e-6)


@given(st.lists(st.integers(0, 99), min_size=2, max_size=99), st.integers(0, 255))
def test_missing_numbers_are_counted(gaps, first):
    places = first + np.cumsum(np.array(gaps) + 1)
    numbers = (places % 256).astype(np.uint8)
    assert lost_packets(numbers) == sum(gaps[1:])
    # A packet that arrives out of order is no loss.
    swapped = numbers.copy()
    if len(gaps) > 3 and max(gaps) < 40:
        swapped[[1, 2]] = swapped[[2, 1]]
        assert lost_packets(swapped) == sum(gaps[1:])


def test_answers_to_others_are_no_round_trip():
    asked = np.array([7, 8]), np.array([1.0, 2.0])
    answered = np.array([8, 9]), np.array([2.5, 2.6])
    assert half_round_trip(asked, answered) == (0.25, 1)
    assert half_round_trip(asked, (np.array([9]), np.array([3.0]))) == (None, 0)


def test_messages_without_a_time_are_placed_whatever_the_drift(opened):
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    log = Tlog()
    m = log.dialect
    boot = 10.0 + 0.2 * np.arange(1500)
    for at in boot:
        arrives = 1.7e9 + (1.0 + DRIFT) * at + LEAST
        log.add(arrives, m.MAVLink_heartbeat_message(2, 3, 128 | 1, 4, 4, 3))
        log.add(arrives, m.MAVLink_attitude_message(round(1e3 * at), 0, 0, 0, 0, 0, 0))
        log.add(arrives, m.MAVLink_nav_controller_output_message(5.0, 0, 0, 0, 0, 0, 0, 0))
    found = opened(log.data)
    # By the end the clocks are 30 ms further apart than at the start.
    assert found.contents.topics["NAV_CONTROLLER_OUTPUT"].time == pytest.approx(boot, abs=1e-3)
    assert found.link.drift == pytest.approx(DRIFT, abs=5e-6)
