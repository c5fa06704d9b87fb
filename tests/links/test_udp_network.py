"""The network between plant and controller: its effect on packets is determined by its seed."""

import math
import random
import statistics

import pytest
from deadtime.links.udp import (
    Bursts,
    ClockOffset,
    Constant,
    LogNormal,
    Network,
    Normal,
    Percentiles,
    ShiftedGamma,
    network_of,
)
from deadtime.links.udp.described import network_from, network_text
from hypothesis import given, strategies as st

FULL = Network(
    delay=LogNormal(0.04, 0.05, 0.02),
    loss=Bursts(0.1, 0.3, good=0.01, bad=0.9),
    duplication=0.2,
    ordered=True,
    rate=1e5,
    queue=0.1,
    blackouts=((1.0, 2.0),),
    reversed_groups=3,
)


def through(network, packets=400, seed=1, spacing=0.01):
    path = network.path(seed)
    arrivals = []
    for number in range(packets):
        arrivals += path.send(number * spacing, number.to_bytes(56, "big"))
    return path, [(time, int.from_bytes(packet, "big")) for time, packet in arrivals]


@pytest.mark.parametrize("network", [FULL, Network(0.05), Network(Normal(0.05, 0.01), 0.3)])
def test_the_same_seed_gives_the_same_network_and_another_seed_another(network):
    assert through(network, seed=3) == through(network, seed=3)
    if network != Network(0.05):
        assert through(network, seed=3)[1] != through(network, seed=4)[1]


@pytest.mark.parametrize(
    "delays",
    [Normal(0.05, 0.005), ShiftedGamma(0.04, 0.05, 0.005), LogNormal(0.04, 0.05, 0.005)],
    ids=lambda one: type(one).__name__,
)
def test_delays_have_the_stated_moments(delays):
    numbers = random.Random(1)
    drawn = [delays.draw(numbers) for _ in range(20_000)]
    assert statistics.mean(drawn) == pytest.approx(delays.mean, abs=2e-4)
    assert statistics.stdev(drawn) == pytest.approx(delays.deviation, rel=0.05)
    assert min(drawn) >= getattr(delays, "least", 0.0)


def test_a_normal_delay_is_never_negative():
    numbers = random.Random(1)
    assert min(Normal(0.001, 0.01).draw(numbers) for _ in range(1000)) == 0.0


def test_losses_occur_singly_and_in_bursts():
    for loss in (0.05, Bursts.of(0.05, 5.0)):
        path, arrivals = through(Network(loss=loss), packets=40_000)
        assert path.lost / path.sent == pytest.approx(0.05, abs=0.006)
        assert len(arrivals) + path.lost == path.sent
    assert Bursts.of(0.05, 5.0).mean == pytest.approx(0.05)
    came = {number for _, number in arrivals}
    lost = [number not in came for number in range(40_000)]
    starts = sum(now and not before for before, now in zip([False, *lost], lost, strict=False))
    assert sum(lost) / starts == pytest.approx(5.0, rel=0.1)


def test_duplicates_do_not_change_the_losses_and_losses_do_not_change_the_delays():
    def network(loss, duplication):
        return Network(Normal(0.05, 0.01), loss=loss, duplication=duplication)

    lossy = {number for _, number in through(network(0.2, 0.0))[1]}
    assert {number for _, number in through(network(0.2, 0.5))[1]} == lossy
    whole = [time - 0.01 * number for time, number in through(network(0.0, 0.0))[1]]
    left = [time - 0.01 * number for time, number in through(network(0.2, 0.0))[1]]
    assert left == pytest.approx(whole[: len(left)])


def test_packets_overtake_each_other_unless_the_network_is_ordered():
    wild = [number for _, number in sorted(through(Network(Normal(0.05, 0.02)))[1])]
    tame = [number for _, number in through(Network(Normal(0.05, 0.02), ordered=True))[1]]
    times = [time for time, _ in through(Network(Normal(0.05, 0.02), ordered=True))[1]]
    assert wild != sorted(wild)
    assert tame == sorted(tame)
    assert times == sorted(times)


def test_a_limited_rate_delays_packets_and_a_short_queue_drops_them():
    # 56 bytes at 2800 bytes/s take 20 ms; a packet is sent every 10 ms.
    path, arrivals = through(Network(rate=2800.0, queue=0.1), packets=200)
    waits = [time - 0.01 * number for time, number in arrivals]
    assert max(waits) <= 0.1 + 0.02 + 1e-9
    assert path.dropped == pytest.approx(100, abs=10)


def test_a_blackout_drops_everything():
    _, arrivals = through(Network(delay=0.05, blackouts=((1.0, 3.0),)))
    assert [number for _, number in arrivals] == [*range(100), *range(300, 400)]


def test_groups_arrive_in_reversed_order():
    _, arrivals = through(Network(delay=0.05, reversed_groups=4), packets=9)
    assert [number for _, number in arrivals] == [3, 2, 1, 0, 7, 6, 5, 4]
    assert arrivals[0][0] == pytest.approx(0.08)


def test_some_packets_arrive_twice():
    path, arrivals = through(Network(delay=0.05, duplication=0.25), packets=4000)
    assert path.duplicated / path.sent == pytest.approx(0.25, abs=0.03)
    assert len(arrivals) == path.sent + path.duplicated


@pytest.mark.parametrize("network", [FULL, Network(), Network(Constant(0.1), 0.2), network_of()])
def test_a_network_survives_conversion_to_text(network):
    assert through(network_from(network_text(network)))[1] == through(network)[1]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: Network(loss=1.5), "probability"),
        (lambda: Network(delay=-0.1), "negative"),
        (lambda: Network(blackouts=((2.0, 1.0),)), "no duration"),
        (lambda: Bursts(0.1, 0.0), "never end"),
        (lambda: Bursts.of(0.9, 1.5), "longer"),
        (lambda: Bursts.of(0.05, math.inf), "finite"),
        (lambda: network_of("gamma", 0.0, 0.01), "cannot have"),
        (lambda: ShiftedGamma(0.05, 0.05, 0.01), "must be above"),
        (lambda: network_of("pareto"), "do not exist"),
        (lambda: network_from("{}"), "describe"),
    ],
)
def test_invalid_networks_are_refused_with_the_reason(wrong, words):
    with pytest.raises(ValueError, match=words):
        wrong()


@given(
    offset=st.floats(-1e6, 1e6),
    ways=st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)), min_size=1, max_size=20),
)
def test_the_offset_of_a_clock_is_within_its_bounds(offset, ways):
    clock = ClockOffset()
    for number, (there, back) in enumerate(ways):
        sent = float(number)
        clock.add(
            sent, sent + there + offset, sent + there + offset + 0.1, sent + there + 0.1 + back
        )
    assert abs(clock.offset - offset) <= clock.uncertainty + 1e-9 * (1.0 + abs(offset))


def test_percentiles_of_no_data_have_count_zero():
    assert Percentiles.of([]).count == 0
    assert Percentiles.of([1.0, 3.0]).p50 == 2.0
