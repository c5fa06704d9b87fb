"""`deadtime watch`: a table, a table that grows, and a link that is only listened to."""

from __future__ import annotations

import codecs
import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from browser import check_tab, chromium
from command_line import run
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
    with pytest.raises(
        dtm.RecordingError, match=r"no column 'command'\. Its columns are time, output"
    ):
        list(growing_rows(path, COLUMNS, 0.1))


CONTENT = "time;ö;command\n0,0;1,25;-0,5\n0,1;1,5;0\n"


@pytest.mark.parametrize(
    "raw",
    [
        CONTENT.encode(),
        codecs.BOM_UTF8 + CONTENT.encode(),
        CONTENT.encode("utf-16"),
        CONTENT.encode("latin-1"),
        CONTENT.replace("\n", "\r\n").encode("utf-16"),
        CONTENT.replace("\n", "\r").encode("latin-1"),
        CONTENT.replace(",", ".").replace(";", ",").encode("utf-16"),
        CONTENT.replace(",", ".").replace(";", "  ").encode("latin-1"),
        CONTENT.replace("\n0,1", "\n# a remark\n\n0,1").encode(),
        b'time,\xf6,command\n"0,0","1,25","-0,5"\n"0,1","1,5",0\n',
    ],
)
def test_a_growing_table_may_be_in_every_encoding_and_with_every_separator(
    tmp_path, monkeypatch, raw
):
    """Marks, UTF-16, Latin-1, and semicolons with decimal commas were refused."""
    path, columns = tmp_path / "log.csv", ("time", "ö", "command")
    path.write_bytes(raw[:7])

    def write():
        with path.open("ab") as file:
            file.write(raw[7:])

    monkeypatch.setattr(_growing, "time", Clock(write))
    rows = list(growing_rows(path, columns, 5.0))
    assert rows == [Row(0.0, 1.25, -0.5), Row(0.1, 1.5, 0.0)]
    assert rows == list(growing_rows(path, columns, 0.0))


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"time,output,command\n0.0,1.0,0.5" + b"0" * 200_000, "line 2 .*more than 100000 char"),
        (b"0" * 200_000, "line 1 .*more than 100000 char"),
        (b"time,output,command\n0.0,1.0,x" + b"0" * 90_000, r"line 2 .{,200}give a finite number"),
        (b"time,output,command\n0.0,inf,0.5\n", "line 2 .*give a finite number"),
        (b"time,output,command\nnan,1.0,0.5\n", "line 2 .*give a finite number"),
        (b'time,output,command\n0.0,"1.0,0.5\n', "line 2 .*give a finite number"),
        (b"time;output;command\n1,234;1;1\n", "line 2 .*write a decimal point"),
        (b"time;output;command\n0,5;1.5;1\n", "line 2 .*write a decimal point"),
        (b"\x1f\x8b\x08\x00", "--follow can read only a text file"),
        (b"\x00\x01\x02", "is neither a text file"),
        (b"\xa3\x95\x80", "open_log"),
    ],
)
def test_what_is_no_growing_table_is_refused_in_a_short_line(tmp_path, raw, said):
    """A line of 131 073 characters was a traceback."""
    path = tmp_path / "log.csv"
    path.write_bytes(raw)
    with pytest.raises(dtm.RecordingError, match=said) as refusal:
        list(growing_rows(path, COLUMNS, 0.0))
    assert len(str(refusal.value)) < 400 + len(str(path))


def table(tmp_path, end=""):
    rows = "".join(f"{0.1 * k!r},{0.01 * k!r},0.1\n" for k in range(30))
    path = tmp_path / "log.csv"
    path.write_text("time,output,command\n" + rows + end)
    return path


def test_an_error_loses_no_row_that_came_before(tmp_path):
    """One wrong line ended the command without the summary of all others."""
    path = table(tmp_path, "3.0,inf,0.1\n")
    done = run("watch", path, "--follow", "--noise", 0.01, "--silence", 0.1)
    assert done.returncode == 1
    assert "line 32" in done.stderr
    assert "Summary of the 30 rows that are printed above:" in done.stdout


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGTERM to catch")
def test_sigterm_ends_as_ctrl_c_does(tmp_path):
    """The summary was lost."""
    command = ["watch", str(table(tmp_path)), "--follow", "--noise", "0.01"]
    program = "from deadtime._cli.app import run; run()"
    with subprocess.Popen(
        [sys.executable, "-uc", program, *command], stdout=subprocess.PIPE, text=True
    ) as watching:
        assert watching.stdout is not None
        for line in watching.stdout:
            if line.startswith("2."):  # the last row that is printed
                break
        watching.send_signal(signal.SIGTERM)
        rest = watching.stdout.read()
    assert watching.returncode == 0
    # The signal may come before the last rows are read.
    assert " rows that are printed above:" in rest


def is_free(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        try:
            line.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


def listened(frames, system=None):
    """What is heard of frames on a link, by their order; nothing may be sent to their sender."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    found = []
    address = LinkAddress("udp", "127.0.0.1", port)
    listener = threading.Thread(
        target=lambda: found.extend(heard_rows(address, "z", 2.0, system=system))
    )
    listener.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.settimeout(0.1)
        while is_free(port):
            time.sleep(0.005)
        for frame in frames:
            vehicle.sendto(frame, ("127.0.0.1", port))
        with pytest.raises(TimeoutError):
            vehicle.recv(2048)
    listener.join()
    return found


def heartbeat():
    return dialect().MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)


def position(height):
    return dialect().MAVLink_local_position_ned_message(0, 0, 0, -height, 0, 0, 0)


def set_point(climb, mask=0b110111000111, system=1):
    target = (system, 1, dialect().MAV_FRAME_LOCAL_NED)
    return dialect().MAVLink_set_position_target_local_ned_message(
        0, *target, mask, 0, 0, 0, 0, 0, -climb, 0, 0, 0, 0, 0
    )


def test_a_link_is_listened_to_and_never_answered():
    sent = [heartbeat(), set_point(0.5), position(3.0), set_point(9.0, 0b111111111000)]
    codec = Codec(1, 1)
    found = listened([*map(codec.encode, sent), b"\xfd\x09nonsense"])
    assert [type(event) for event in found] == [Sent, Row]
    assert found[0].value == 0.5
    assert found[1].output == 3.0
    assert found[1].time > found[0].time


@pytest.mark.parametrize("system", [None, 1])
def test_only_the_vehicle_counts_on_a_link_and_only_finite_numbers(system):
    """One position of infinity from any sender ended the command, and all senders were believed."""
    own, other, camera = Codec(1, 1), Codec(7, 1), Codec(1, 100)
    first = [other.encode(heartbeat())] if system else []
    frames = [own.encode(heartbeat()), own.encode(position(3.0))]
    for value in (5.0, math.inf, math.nan):
        frames += [sender.encode(position(value)) for sender in (other, camera)]
        frames += [other.encode(heartbeat()), other.encode(set_point(value, system=7))]
    for value in (math.inf, -math.inf, math.nan):
        frames += [own.encode(position(value)), other.encode(set_point(value))]
    frames += [other.encode(set_point(0.5)), own.encode(position(4.0))]
    found = listened([*first, *frames], system)
    assert [event[1] for event in found] == [3.0, 0.5, 4.0]


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
