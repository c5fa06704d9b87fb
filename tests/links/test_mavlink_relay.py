"""What the package's relay adds between ArduPilot and the ground station is found again."""

import json
import math

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from arducopter import told_by

pytestmark = [pytest.mark.survey, pytest.mark.flight, pytest.mark.long]

#: What the relay adds to the round trip, s.
ADDED = 0.26

#: Losses of the rough link, and time between commands, s.
LOSS, SAMPLE = 0.05, 0.065


@pytest.fixture(scope="module")
def links(tmp_path_factory):
    folder = tmp_path_factory.mktemp("relay")
    found = json.loads(told_by("arducopter_relay.py", str(folder), timeout=900.0).splitlines()[-1])
    if any(reasons := [one["irregular"] for one in found]):
        pytest.skip(f"this machine is too busy for a loop in real time: {reasons}")
    return found


def test_the_link_s_share_by_timesync_is_what_the_relay_adds(links):
    near, far, _ = links
    assert far["least"] - near["least"] == pytest.approx(ADDED, abs=0.005)


def test_the_echo_of_the_set_point_is_later_by_what_the_relay_adds(links):
    """Up to the spacing of the messages."""
    near, far, _ = links
    assert far["echo"] - near["echo"] == pytest.approx(ADDED, abs=0.02)


def half_widths(*found):
    """Half width of the interval of the difference of two estimates, s."""
    return math.hypot(*[0.5 * (one["interval"][1] - one["interval"][0]) for one in found])


def test_the_delay_rises_by_what_the_relay_adds(links):
    """Seen with the rows on the vehicle's clock: 265, 262 and, on a busy machine, 275 ms.

    There the echo rose by 268, 252 and 273 ms: commands do wait longer where the relay and the
    vehicle have to wait for a processor.
    """
    near, far, _ = links
    rise, echo = (far[name] - near[name] for name in ("total", "echo"))
    assert rise == pytest.approx(ADDED, abs=1.5 * half_widths(near, far))
    assert min(ADDED, echo) - 0.02 < rise < max(ADDED, echo) + 0.02
    for one in (near, far):  # with the limits of the vehicle in the plant, it follows its set point
        assert one["gain"] == pytest.approx(1.0, abs=0.05)


def test_with_jitter_and_losses_the_interval_holds_the_mean(links):
    """A lost command prolongs the one before, on average by a share of the sample time."""
    near, _, rough = links
    rise = rough["total"] - near["total"]
    assert rise == pytest.approx(ADDED + LOSS * SAMPLE, abs=half_widths(near, rough))
    assert half_widths(rough) < 0.03
    assert rough["mean"] - near["mean"] == pytest.approx(ADDED, abs=0.03)
