"""No single packet of the peer moves the counts and the clock of a report."""

from __future__ import annotations

import pytest
from deadtime.links.udp.endpoint import Endpoint
from deadtime.links.udp.packets import LoopPacket
from deadtime.links.udp.statistics import LinkStatistics
from deadtime.links.udp.wires import wire_of

PEER = ("127.0.0.1", 9)


class Loop:
    """An event loop that stands at a time, s."""

    now = 0.0

    def time(self):
        return self.now

    def call_soon(self, *_):
        pass


def report_of(forged, answers_only):
    """The report after 100 exchanges over 1 ms each way, with clocks 50 s apart."""
    wire, endpoint = wire_of(None), None
    endpoint = Endpoint(wire, lambda _: None, PEER, answers_only=answers_only)
    endpoint._loop = clock = Loop()
    endpoint._closed = type("Open", (), {"is_set": lambda _: False})()
    for number in range(1, 101):
        clock.now = sent = 0.01 * number
        endpoint.send(LoopPacket(number, sent))
        clock.now = sent + 0.002
        if number == 50 and forged is not None:
            far = LoopPacket(forged[0], sent + forged[1], number, sent)
            endpoint._receive(wire.encode(far), PEER)
        true = LoopPacket(number, sent + 50.001, number, sent)
        endpoint._receive(wire.encode(true), PEER)
    return endpoint.statistics.report()


@pytest.mark.parametrize("answers_only", [True, False])
@pytest.mark.parametrize("forged", [(2**32 - 1, 50.001), (51, -529.0), (2**32 - 1, -529.0)])
def test_one_forged_packet_of_the_peer_moves_neither_counts_nor_clock(forged, answers_only):
    """The report said "lost 4 294 966 474" and "offset -529 s"."""
    report = report_of(forged, answers_only)
    assert (report.lost, report.invalid, report.received) == (0, 1, 100)
    assert report.offset == pytest.approx(50.0, abs=1e-6)
    assert report.offset_uncertainty == pytest.approx(0.001, abs=1e-6)
    assert report.round_trip == report_of(None, answers_only).round_trip


def exchanges(statistics, offset, numbers, drift=0.0):
    for number in numbers:
        sent = 0.01 * number
        there = sent + 0.001 + offset + drift * number
        statistics.exchanged(LoopPacket(number, there, number, sent), sent + 0.002)


def test_an_end_that_restarts_with_another_clock_has_the_offset_of_the_new_one():
    """Bounds of two clocks met nowhere, which a report showed as "± 0.0"."""
    statistics = LinkStatistics()
    exchanges(statistics, 50.0, range(100))
    exchanges(statistics, -7.0, range(100, 110))
    report = statistics.report()
    assert report.offset == pytest.approx(-7.0, abs=1e-6)
    assert report.offset_uncertainty == pytest.approx(0.001, abs=1e-6)
    assert report.forward_delay == pytest.approx((0.0, 0.002), abs=1e-6)


def test_a_clock_that_drifts_has_the_offset_of_the_newest_exchange():
    statistics = LinkStatistics()
    exchanges(statistics, 50.0, range(1000), drift=1e-5)
    report = statistics.report()
    newest = 50.0 + 999e-5
    assert report.offset_uncertainty > 0.0
    assert abs(report.offset - newest) <= 0.002
