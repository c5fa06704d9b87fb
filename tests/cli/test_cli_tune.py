"""``deadtime tune``: what it prints, writes and refuses."""

import numpy as np
import pytest
from command_line import found, one_clear_line, run
from made_logs import flown_copter


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("tune")
    time = np.arange(300.0)
    command = np.where(time < 60.0, 40.0, 45.0)
    output = 55.0 + 9.0 * (1.0 - np.exp(-np.maximum(time - 72.0, 0.0) / 40.0))
    output += np.random.default_rng(3).normal(0.0, 0.1, time.size)
    table = np.column_stack([time, output, command])
    np.savetxt(place / "bump.csv", table, delimiter=",", header="sec,PV,OP", comments="")
    noise = np.column_stack([time, np.random.default_rng(1).normal(size=time.size), command])
    np.savetxt(place / "noise.csv", noise, delimiter=",", header="sec,PV,OP", comments="")
    gains = (("ATC_RAT_RLL_P", 0.9),)
    (place / "flown.bin").write_bytes(flown_copter(seconds=6.0, parameters=gains).data)
    (place / "bare.bin").write_bytes(flown_copter(seconds=6.0).data)
    return place


def test_a_bump_test_gives_lines_to_type_and_a_page(folder):
    pytest.importorskip("matplotlib", reason="matplotlib draws")
    options = ["--form", "ideal", "--spans", 100, 100, "--out", "gains.html"]
    done = run("tune", "bump.csv", *options, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("reliable: PI with Kp = ")
    for words in ("Kc = ", "Ti = ", "PB = ", "least margins", "deadtime tune next.csv"):
        assert words in done.stdout
    assert "Kc = " in (folder / "gains.html").read_text(encoding="utf-8")


def test_gains_that_were_in_use_bound_the_step(folder):
    told = found("tune", "bump.csv", "--kp", 0.1, "--ki", 0.001, cwd=folder)
    assert told["gains"] == pytest.approx({"Kp": 0.2, "Ki": 0.002})
    assert told["flown"] == {"Kp": 0.1, "Ki": 0.001}


def test_a_record_without_a_plant_gives_none(folder):
    done = run("tune", "noise.csv", cwd=folder)
    assert done.returncode == 3
    assert done.stdout.startswith("none: no gains were proposed, because")


def test_a_log_gives_the_parameters_of_its_firmware(folder):
    told = found("tune", "flown.bin", "--loop", "roll rate", cwd=folder)
    assert told["flown"] == pytest.approx({"Kp": 0.9})
    names = [line.partition(",")[0] for line in told["settings"]["lines"]]
    assert names == ["ATC_RAT_RLL_P", "ATC_RAT_RLL_I", "ATC_RAT_RLL_D"]
    # Seen: the plant is GAIN/(s (LAG s + 1)) behind 30 ms; half to twice 0.9 is allowed.
    assert 0.45 <= told["gains"]["Kp"] <= 1.8
    assert told["margins"]["gain_margin"] > 2.0


REFUSED = [
    (["bare.bin", "--loop", "roll rate"], "by controller=, or by --controller on the command line"),
    (["flown.bin", "--loop", "altitude"], "has no loop 'altitude'"),
    (["flown.bin", "--kp", 1], "--kp applies only to tables"),
    (
        ["bump.csv", "--form", "ardupilot"],
        "--loop is missing: give one of the loops of ardupilot, which are roll rate",
    ),
    (
        ["bump.csv", "--form", "px4", "--loop", "rol"],
        "--loop rol: give one of the loops of px4, which are roll rate",
    ),
    (
        ["bump.csv", "--loop", "roll"],
        "--loop applies only to a form for a vehicle, and --form parallel is none",
    ),
    (["bump.csv", "--firmware", "4.5"], "--firmware applies only to a form for a vehicle"),
    (["bump.csv", "--filter-hz", 2], "--filter-hz belongs to a derivative"),
    (["bump.csv", "--controller", "PID", "--form", "px4", "--loop", "altitude"], "no integral"),
]


@pytest.mark.parametrize(("options", "why"), REFUSED)
def test_what_makes_no_sense_is_refused(folder, options, why):
    done = run("tune", *options, cwd=folder)
    assert done.returncode == 1
    one_clear_line(done)
    assert why in done.stderr


def test_what_refuses_each_loop_of_a_log_names_it_once(folder):
    done = run("tune", "bare.bin", cwd=folder)
    assert done.returncode == 3
    assert "roll rate: the log contains no gain of this loop" in done.stderr
