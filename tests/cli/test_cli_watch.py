"""`deadtime watch`: a table, a table that grows, and a link that is only listened to."""

from __future__ import annotations

import json
import socket
import threading
import time
import urllib.error
import urllib.request
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from browser import check_tab, chromium
from deadtime._cli.watch import recorded_rows
from deadtime._cli.watch_page import WatchPage
from deadtime.estimation import online
from deadtime.links.mavlink import LinkAddress, heard_rows
from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.recordings import Row, Sent, _growing, growing_rows

COLUMNS = ("time", "output", "command")


class Clock:
    """The time of a reader that waits for what is written when it first waits."""

    def __init__(self, write):
        self.now, self.write = 0.0, write

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        if self.now == 0.0:
            self.write()
        self.now += seconds


def test_a_growing_table_gives_the_rows_of_the_whole(tmp_path, monkeypatch):
    values = np.random.default_rng(1).normal(size=(20, 2))
    lines = [f"{0.1 * k!r},{y!r},{u!r}\n" for k, (y, u) in enumerate(values.tolist())]
    whole, part = tmp_path / "whole.csv", tmp_path / "part.csv"
    whole.write_text("time,output,command\n" + "".join(lines))
    part.write_text("time,output,command\n" + "".join(lines[:10]) + lines[10][:7])

    def write():
        with part.open("a") as file:
            file.write(lines[10][7:] + "".join(lines[11:]))

    clock = Clock(write)
    monkeypatch.setattr(_growing, "time", clock)
    found = list(growing_rows(part, COLUMNS, silence=5.0))
    assert clock.now > 5.0
    assert found == list(recorded_rows(whole, COLUMNS))


def test_a_saved_recording_is_watched_as_it_is(tmp_path):
    path = tmp_path / "saved.csv"
    times = np.arange(9.0)
    saved = dtm.Recording(times, times, 2.0 * times, 3.0 * times)
    saved.save(path)
    assert list(growing_rows(path, COLUMNS, 0.1)) == list(recorded_rows(path, COLUMNS))


def test_lost_cells_and_wrong_ones_of_a_growing_table(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,output,command\n0.0,,0.5\n0.1,1.0,\n")
    assert list(growing_rows(path, COLUMNS, 0.1)) == [Row(0.0, None, 0.5), Row(0.1, 1.0, None)]
    path.write_text("time,output,command\n0.0,height,0.5\n")
    with pytest.raises(dtm.RecordingError, match=r"line 2 of .*log\.csv is '0.0,height,0.5'"):
        list(growing_rows(path, COLUMNS, 0.1))
    path.write_text("time,output\n")
    with pytest.raises(dtm.RecordingError, match="no column 'command', only time, output"):
        list(growing_rows(path, COLUMNS, 0.1))


def is_free(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        try:
            line.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


def test_a_link_is_listened_to_and_never_answered():
    messages, codec = dialect(), Codec(1, 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    found = []
    listener = threading.Thread(
        target=lambda: found.extend(heard_rows(LinkAddress("udp", "127.0.0.1", port), "z", 2.0))
    )
    listener.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.settimeout(0.1)
        while is_free(port):
            time.sleep(0.005)
        target = (1, 1, messages.MAV_FRAME_LOCAL_NED)
        sent = [
            messages.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3),
            messages.MAVLink_set_position_target_local_ned_message(
                0, *target, 0b110111000111, 0, 0, 0, 0, 0, -0.5, 0, 0, 0, 0, 0
            ),
            messages.MAVLink_local_position_ned_message(0, 0, 0, -3.0, 0, 0, 0),
            messages.MAVLink_set_position_target_local_ned_message(
                0, *target, 0b111111111000, 0, 0, 0, 0, 0, -9.0, 0, 0, 0, 0, 0
            ),
        ]
        for message in sent:
            vehicle.sendto(codec.encode(message), ("127.0.0.1", port))
        vehicle.sendto(b"\xfd\x09nonsense", ("127.0.0.1", port))
        with pytest.raises(TimeoutError):
            vehicle.recv(2048)
    listener.join()
    assert [type(one) for one in found] == [Sent, Row]
    assert found[0].value == 0.5
    assert found[1].output == 3.0
    assert found[1].time > found[0].time


def test_a_link_that_would_be_sent_to_is_refused():
    with pytest.raises(ValueError, match="give udp:HOST:PORT"):
        list(heard_rows(LinkAddress.of("tcp:127.0.0.1:5760"), "z", 0.1))


@pytest.mark.survey
def test_labels_are_as_large_on_a_phone_and_nothing_is_missing():
    rows = 0.065 * np.arange(200)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0))
    one = online(dtm.Recording(rows, rows, rows, rows), loop, noise=0.01).last
    shown = WatchPage("a flight")
    try:
        for moment in (0.0, 5.0, 10.0):
            shown.show(replace(one, time=moment, known=True))
        with chromium() as browser:
            tab = browser.new_page()
            missing: list[str] = []
            tab.on("response", lambda it: it.ok or missing.append(it.url))
            for width in (1300, 360):
                tab.set_viewport_size({"width": width, "height": 800})
                tab.goto(shown.address)
                tab.wait_for_selector("#marks text")
                boxes = tab.evaluate(
                    "() => [...document.querySelectorAll('#marks text')]"
                    ".map((label) => label.getBoundingClientRect())"
                    ".map((box) => [box.height, box.right])"
                )
                heights, ends = zip(*boxes, strict=True)
                assert min(heights) >= 12.0
                assert max(ends) <= width
                check_tab(tab, width)
            assert missing == []
    finally:
        shown.close()


def test_the_page_is_for_this_computer_alone():
    steps = 0.065 * np.arange(12)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0))
    last = online(dtm.Recording(steps, steps, steps, steps), loop, noise=0.01).last
    shown = WatchPage("<flight>.csv")
    try:
        shown.show(last)
        with urllib.request.urlopen(shown.address, timeout=5) as answer:
            text = answer.read().decode()
        assert "&lt;flight&gt;.csv" in text
        assert "http://" not in text.replace("http://www.w3.org", "")
        with urllib.request.urlopen(shown.address + "track", timeout=5) as answer:
            found = json.loads(answer.read())
        assert found["rows"][0][:2] == [last.time, last.delay]
        foreign = urllib.request.Request(shown.address, headers={"Host": "evil.example:80"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(foreign, timeout=5)
    finally:
        shown.close()
