"""Files that are damaged, cut off or something else: one clear message, or what can be read."""

import random
import signal
import struct
import subprocess
import sys
import tracemalloc

import deadtime as dtm
import numpy as np
import pytest
from flights import flight_path
from made_logs import DataFlash, ULogFile, copter
from mutations import mutated
from small_logs import SMALL, small_blackbox, small_crazyflie, small_text, small_tlog

MEGABYTE = 1 << 20

#: After so many seconds a reader hangs.
PATIENCE = 60

#: What opens a table.
TABLE = r"open it with dtm\.read_recording\(path\)"


class HangsError(BaseException):
    """No `Exception`, which the reader takes for a damage of the file."""


@pytest.fixture
def impatient():
    """A reader that hangs fails."""

    def ended(*_):
        raise HangsError(f"the reader has not ended after {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, ended)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def opened_or_refused(path):
    """The log, or the message with which it was refused."""
    signal.alarm(PATIENCE)
    try:
        log = dtm.open_log(path)
    except dtm.RecordingError as error:
        return str(error)
    finally:
        signal.alarm(0)
    return log


@pytest.mark.parametrize("name", SMALL)
def test_the_small_logs_are_read_and_small(name, tmp_path):
    library, made = SMALL[name]
    pytest.importorskip(library, reason=f"{library} reads {name}")
    data = made()
    assert len(data) <= 4096
    path = tmp_path / "flight"
    path.write_bytes(data)
    log = dtm.open_log(path)
    assert log.format == name
    assert log.loops
    assert log.remarks == (
        ("the logger lost data 1 times, for 0.03 s in total",) * (name == "ULog")
    )


@pytest.mark.parametrize(
    "count", [30, pytest.param(200, marks=[pytest.mark.survey, pytest.mark.long])]
)
@pytest.mark.parametrize("name", SMALL)
def test_damaged_logs_end_in_a_log_or_a_clear_message(name, count, tmp_path, capfd, impatient):
    library, made = SMALL[name]
    pytest.importorskip(library, reason=f"{library} reads {name}")
    draw = random.Random(19)
    whole = made()
    path = tmp_path / "flight"
    path.write_bytes(whole)
    dtm.open_log(path)  # imports the library
    read = 0
    tracemalloc.start()
    try:
        for _ in range(count):
            data = mutated(whole, draw)
            path.write_bytes(data)
            tracemalloc.reset_peak()
            log = opened_or_refused(path)
            peak = tracemalloc.get_traced_memory()[1]
            assert peak < 50 * MEGABYTE + 10 * len(data)
            if isinstance(log, str):
                assert path.name in log
                assert len(log.splitlines()) == 1
                continue
            read += 1
            assert log.summary()
            assert log.to_dict()["format"] == name
            for loop in log.loops.values():
                assert np.all(np.diff(loop.setpoint.time) > 0.0)
                assert loop.summary()
    finally:
        tracemalloc.stop()
    assert 0.3 * count < read < count
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("share", [0.3, 0.6, 0.99])
@pytest.mark.parametrize(
    "name", ["px4_sitl_takeoff.ulg", "px4_sample.ulg", "ardupilot_sitl_guided_heights.bin"]
)
def test_a_log_that_is_cut_off_is_read_as_far_as_it_goes(name, share, tmp_path):
    if name.endswith(".ulg"):
        pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    whole = flight_path(name)
    data = whole.read_bytes()
    path = tmp_path / name
    path.write_bytes(data[: int(share * len(data))])
    log, known = dtm.open_log(path), dtm.open_log(whole)
    assert 0.1 * known.duration < log.duration <= known.duration
    assert log.vehicle == known.vehicle
    for loop in log.loops.values():
        whole_loop = known.loops[loop.name]
        if loop.setpoint.source == whole_loop.setpoint.source:  # not where all are NaN so far
            rows = whole_loop.setpoint.values[: len(loop.setpoint)]
            assert np.array_equal(loop.setpoint.values, rows, equal_nan=True)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"\x07\x03time", "is not a log of a known format, because it begins with 07 03 74 69"),
        (b"time,reference\n0,1\n", rf"is a text, but not a log .*: {TABLE}"),
        ("höhe\n".encode("latin-1"), rf"is a text, but not a log .*: {TABLE}"),
        (
            b"version https://git-lfs.github.com/spec/v1\noid sha256:da9\nsize 11927552\n",
            "is a Git LFS pointer instead of the file itself: run `git lfs pull`",
        ),
        (b"\x1f\x8b\x08" + bytes(20), rf"is packed by gzip: {TABLE}"),
        (b"PAR1" + bytes(20), rf"is a Parquet table: {TABLE}"),
        (b"ARROW1\0\0" + bytes(20), rf"is an Arrow table: {TABLE}"),
        (b"MATLAB 5.0 MAT-file" + bytes(200), rf"is a MAT file: {TABLE}"),
        (b"MATLAB 7.3 MAT-file" + bytes(200), rf"is a MAT file: {TABLE}"),
        (b"PK\x03\x04" + bytes(200), "is a zip archive, .*: unpack the archive"),
        (b"\xa3\x95\x80" + bytes(200), "contains no message of a known format"),
        (b"\xa3\x95\x07", "contains no message of a known format"),
        (b"FMT, 1, 2, ATT, Qc, TimeUS\nATT, 1, 2\n", "contains no message of a known format"),
    ],
)
def test_other_files_are_refused_with_what_is_wrong(data, words, tmp_path):
    path = tmp_path / "flight.bin"
    path.write_bytes(data)
    with pytest.raises(dtm.RecordingError, match=words):
        dtm.open_log(path)


def test_a_ulog_of_a_header_alone_is_refused(tmp_path):
    pytest.importorskip("pyulog", reason="pyulog reads ULog files")
    path = tmp_path / "flight.ulg"
    for length in (7, 12, 16):
        path.write_bytes(ULogFile().data[:length])
        with pytest.raises(dtm.RecordingError, match=r"flight\.ulg is a (damaged )?ULog"):
            dtm.open_log(path)


def test_a_tlog_without_an_autopilot_is_refused(tmp_path):
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    path = tmp_path / "flight.tlog"
    path.write_bytes(struct.pack(">Q", 17 * 10**14) + b"\xfe\x01\x00\x00\x00\x00\x00\x00\x00")
    with pytest.raises(dtm.RecordingError, match="contains no HEARTBEAT of an autopilot"):
        dtm.open_log(path)


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(dtm.RecordingError, match="does not exist"):
        dtm.open_log(tmp_path / "flight.ulg")
    with pytest.raises(dtm.RecordingError, match="is a folder"):
        dtm.open_log(tmp_path)


def test_a_format_of_length_zero_does_not_hang(tmp_path):
    # pymavlink never ends on it.
    log = DataFlash()
    log.define("ATT", 5, "Qcc", "TimeUS,DesRoll,Roll")
    log.define("BAD", 6, "Qf", "TimeUS,X", length=0)
    for k in range(20):
        log.add("ATT", 20_000 * k, 100 * (k % 3), 50)
        log.add("BAD", 20_000 * k, 1.0)
    path = tmp_path / "flight.bin"
    path.write_bytes(log.data)
    found = dtm.open_log(path)
    assert len(found.loops["roll"].setpoint) == 20
    assert any("do not belong to a message, and are left out" in remark for remark in found.remarks)


def test_damage_in_the_middle_costs_only_the_messages_in_it(tmp_path):
    data = bytearray(copter(200).data)
    middle = len(data) // 2
    data[middle : middle + 50] = b"\xff" * 50
    path = tmp_path / "flight.bin"
    path.write_bytes(bytes(data))
    found = dtm.open_log(path)
    assert 195 <= len(found.loops["roll"].setpoint) < 200
    assert any("do not belong to a message" in remark for remark in found.remarks)


def test_a_packet_with_a_wrong_checksum_is_left_out(tmp_path):
    pytest.importorskip("pymavlink", reason="pymavlink reads tlogs")
    data = bytearray(small_tlog())
    data[-3] ^= 1  # of the last packet
    path = tmp_path / "flight.tlog"
    path.write_bytes(bytes(data))
    found = dtm.open_log(path)
    assert found.remarks == ("1 packets with a wrong checksum are left out",)
    assert len(found.contents.topics["NAV_CONTROLLER_OUTPUT"].time) == 29


@pytest.mark.parametrize(("name", "library"), [("ULog", "pyulog"), ("tlog", "pymavlink")])
def test_without_its_library_a_format_names_the_line_that_installs_it(name, library, tmp_path):
    pytest.importorskip(library, reason=f"{library} makes the file")
    path = tmp_path / "flight"
    path.write_bytes(SMALL[name][1]())
    code = (
        "import sys\n"
        f"sys.modules[{library!r}] = None\n"
        "import deadtime as dtm\n"
        f"try: dtm.open_log({str(path)!r})\n"
        "except dtm.MissingExtraError as error: print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert "pip install 'deadtime[logs]'" in done.stdout
    assert library in done.stdout


def test_text_of_a_log_does_not_reach_a_terminal_as_controls(tmp_path):
    path = tmp_path / "flight"
    hostile = b"gy\x1b[2J\nro"
    path.write_bytes(small_crazyflie().replace(b"gyro.x(f)", hostile))
    with pytest.raises(
        dtm.RecordingError, match=r'"gy\\x1b\[2J\\nro" does not end in a known type'
    ) as caught:
        dtm.open_log(path)
    assert str(caught.value).isprintable()
    path.write_bytes(small_blackbox().replace(b"Betaflight 4.5.1", b"Beta\x1b[2J\r"))
    found = dtm.open_log(path)
    assert "Beta\\x1b[2J\\r" in found.firmware
    assert all(line.isprintable() for line in found.summary().split("\n"))
    path.write_bytes(small_text().replace(b"ALT_HOLD, 2", b"ALT_HOLD, A\x1bB"))
    found = dtm.open_log(path)
    assert [name for _, name in found.modes] == ["A\\x1bB"]
    assert all(line.isprintable() for line in found.summary().split("\n"))
