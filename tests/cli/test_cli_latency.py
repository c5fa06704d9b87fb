"""``deadtime latency``: how long the loops in a log take, as text, as JSON and as a page."""

import re

import pytest
from command_line import found, one_clear_line, run
from made_logs import copter, flown_copter


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "flight.bin"
    path.write_bytes(flown_copter(seconds=4.0).data)
    return path


def test_text_and_page(log, monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "200")
    result = run("latency", log, "--out", tmp_path / "page.html")
    assert result.returncode == 0, result.stderr
    printed = " ".join(result.stdout.split())
    assert re.match(r"reliable: roll rate, \w+ to response [\d.]+ ± [\d.]+ ms \(95 %: ", printed)
    assert "flight.bin: ArduPilot Copter" in printed
    assert "gyro low-pass: 11.25 ms (INS_GYRO_FILTER 20)" in result.stdout
    assert (tmp_path / "page.html").stat().st_size > 10_000


def test_json_and_two_logs(log):
    told = found("latency", log, log, "--loop", "roll rate")
    for one in told["logs"]:
        assert [loop["command"] for loop in one["loops"]] == ["setpoint", "actuator"]
    assert len(told["logs"]) == 2
    assert all(one["change"] == 0.0 for one in told["changes"])


def test_what_is_wrong_is_one_line(log, tmp_path):
    assert "no loop with the axis 'yaw'" in one_clear_line(run("latency", log, "--axis", "yaw"))
    assert "give one, or two" in one_clear_line(run("latency", log, log, log))
    assert "page of one log" in one_clear_line(run("latency", log, log, "--out", "page.html"))


def test_a_log_of_an_instant_is_answered_by_one_line(tmp_path):
    # 32 ms of a log were answered by a line for each of six loops.
    path = tmp_path / "flight.bin"
    path.write_bytes(copter(rows=3, period=0.016).data)
    result = run("latency", path)
    assert result.returncode == 3
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert "none: flight.bin is 42 ms long" in result.stderr
