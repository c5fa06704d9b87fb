"""``deadtime estimate``: every method by name, its options, several files, and what is refused."""

import json
import re

import deadtime as dtm
import numpy as np
import pytest
from command_line import found, one_clear_line, run
from deadtime.estimation._estimate import METHODS
from flights import flight_path

LOGGED = ["--command", "command"]
FLOWN = ["--sample-time", "0.065", "--limit", "1"]


def write(flight, path):
    columns = np.column_stack([flight.time, flight.reference, flight.output, flight.command])
    header = "time,reference,output,command"
    np.savetxt(path, columns, delimiter=",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Steps of one vehicle under two gains, and a pseudo-random sequence."""
    folder = tmp_path_factory.mktemp("flights")
    flown = {}
    for name, Kp in (("quick", 2.0), ("slow", 0.6)):
        loop = dtm.ControlLoop(
            dtm.Integrator(0.9), dtm.P(Kp), delay=0.36, sample_time=0.065, limit=1.0
        )
        flight = dtm.Experiment.step(8.0, rest=1.04).run(loop, noise=0.004, seed=3)
        flown[name] = write(flight, folder / f"{name}.csv")
    others = {
        "lagging": (dtm.Integrator(0.9, 0.2), dtm.P(1.2)),
        "first order": (dtm.FirstOrder(1.2, 0.8), dtm.PI(1.0, 0.5)),
    }
    for name, (plant, controller) in others.items():
        loop = dtm.ControlLoop(plant, controller, delay=0.3, sample_time=0.065, limit=1.0)
        flight = dtm.Experiment.step(8.0, rest=1.04).run(loop, noise=0.004, seed=3)
        flown[name] = write(flight, folder / f"{name}.csv")
    return flown


@pytest.mark.parametrize(
    ("method", "error"),
    [("auto", 0.005), ("frequency", 0.01), ("grid", 0.01), ("decrement", 0.06), ("gcc", 0.08)],
)
def test_a_method_by_its_name(files, method, error):
    out = found(
        "estimate", files["quick"], "--kp", 2, "--gain", 0.9, *FLOWN, *LOGGED, "--method", method
    )
    assert out["method"] == ("output_error" if method == "auto" else method)
    assert out["delay"] == pytest.approx(0.36, abs=error)


def test_a_file_of_another_format_gives_the_same_estimate(files, tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow reads Parquet files")
    saved = tmp_path / "flight.parquet"
    dtm.read_recording(files["quick"], command="command").save(saved)
    options = ["--kp", 2, *FLOWN, *LOGGED, "--method", "auto"]
    first, second = (found("estimate", file, *options) for file in (files["quick"], saved))
    assert first["delay"] == second["delay"]


def test_the_log_of_an_autopilot_is_refused_by_its_name(tmp_path):
    log = tmp_path / "flight.csv"
    log.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(100))
    told = one_clear_line(run("estimate", log, "--kp", 2))
    assert "is a ULog file of PX4" in told


def test_every_method_is_named_in_the_help():
    told = run("estimate", "--help").stdout
    for name in ("all", "auto", *METHODS):
        assert name in told


def test_options_reach_the_methods_that_have_them(files):
    step = ["estimate", files["quick"], "--kp", 2, *FLOWN, "--method", "waveform"]
    simulated = found(*step, "--noise", "recording")
    assert simulated["noise"] == "recording"
    assert found(*step, "--noise", "loop")["delay"] != simulated["delay"]
    known = found(*step, "--noise", "recording", "--initial-output", 0.0)
    assert known["initial_output"] == 0.0
    assert known["delay"] == pytest.approx(0.36, abs=0.02)


def test_a_logged_command_is_used_and_compared(files, tmp_path):
    picture = tmp_path / "all.png"
    step = ["estimate", files["quick"], "--kp", 2, *FLOWN, "--method", "all"]
    out = found(*step, *LOGGED, "--plot", picture)
    assert {"waveform", "output_error", "decrement"} <= out["estimates"].keys()
    assert out["estimates"]["output_error"]["delay"] == pytest.approx(0.36, abs=0.005)
    assert "the fit to the logged command" in out["explanation"][0]
    assert picture.stat().st_size > 5000
    gcc = out["differences"]["gcc"]
    assert (gcc["rows"], gcc["interval"]) == (124, None)
    assert "correlation" in gcc["limits"]
    assert gcc["seconds"] == pytest.approx(
        out["estimates"]["gcc"]["delay"] - out["estimates"]["output_error"]["delay"]
    )
    assert "output_error" not in found(*step)["estimates"]
    printed = " ".join(run(*step, *LOGGED).stdout.split())
    assert "output error" in printed
    assert "Gcc, on 124 rows from 0 to 7.995 s: " in printed


def test_the_decay_method_is_used_where_nothing_overshoots(files):
    out = found("estimate", files["slow"], "--kp", 0.6, "--gain", 0.9, *FLOWN)
    assert out["estimates"]["decay"]["delay"] == pytest.approx(0.36, abs=0.1)
    assert "decrement" not in out["estimates"]
    assert "no overshoot" in out["refusals"]["dominant"]


def test_several_files_are_fitted_together(files, tmp_path):
    picture = tmp_path / "both.png"
    both = ["estimate", files["quick"], files["slow"], "--kp", 2, "--kp", 0.6, *FLOWN]
    out = found(*both, *LOGGED, "--method", "auto", "--plot", picture)
    assert out["method"] == "output_error"
    alone = found(
        "estimate", files["quick"], "--kp", 2, *FLOWN, *LOGGED, "--method", "output_error"
    )
    assert out["stderr"]["delay"] < alone["stderr"]["delay"]
    assert out["delay"] == pytest.approx(0.36, abs=4 * out["stderr"]["delay"])
    assert picture.stat().st_size > 5000
    assert "2 recordings together" in run(*both, "--method", "waveform").stdout
    same = ["estimate", files["quick"], files["quick"], "--kp", 2, *FLOWN]
    assert found(*same)["parameters"]["delay"] == pytest.approx(0.36, abs=0.02)  # one --kp for all


def test_two_real_flights_together():
    paths = [flight_path(f"ardrone2_height_step_{name}.csv") for name in ("2_4_0_25", "0_5_1_0")]
    columns = ["--time", "t_s", "--reference", "ref_m", "--output", "height_m"]
    out = found(
        "estimate", *paths, *columns, "--kp", 2.4, "--kp", 0.5, *FLOWN, "--window", 13, 25.5
    )
    assert out["verdict"] == "reliable"
    assert out["candidates"][0]["name"] == "integrator, two lags, zero"
    assert out["parameters"]["gain"] == pytest.approx(0.69, abs=0.02)
    assert all(run["noise_std"] < 0.0065 for run in out["recordings"])


def test_a_check_prints_what_it_finds_and_fails_where_it_refuses(files):
    flown = ["estimate", files["quick"], "--kp", 2, "--check", *LOGGED]
    clean = run(*flown, *FLOWN)
    assert clean.returncode == 0
    assert clean.stdout.startswith("quick.csv: 124 rows 65 ms apart, none missing")
    assert "warning" not in clean.stdout
    assert found(*flown, *FLOWN)["recordings"][0]["law"] == "exact"
    refused = run(*flown, "--sample-time", 65, "--limit", 1)
    assert refused.returncode == 1
    assert "• refused: the rows are 0.065 apart" in refused.stdout
    assert refused.stderr == ""
    told = json.loads(run(*flown, "--sample-time", 65, "--json").stdout)
    assert told["refused"] is True
    assert told["recordings"][0]["findings"][0]["code"] == "time_unit"


def test_a_check_of_several_files_is_one_of_each(files):
    both = ["estimate", files["quick"], files["slow"], *LOGGED, *FLOWN, "--check"]
    told = found(*both, "--kp", 2, "--kp", 0.6)
    assert [one["law"] for one in told["recordings"]] == ["exact", "exact"]
    told = found(*both, "--kp", 2)  # one gain for all
    assert [one["law"] for one in told["recordings"]] == ["exact", "differs"]
    assert "slow.csv: 124 rows" in run(*both, "--kp", 2).stdout


def test_the_delay_comes_first_and_warnings_follow(files):
    unlimited = ["estimate", files["quick"], "--kp", 2, "--sample-time", 0.065, *LOGGED]
    for method, rest in (("output_error", "output_error: maximum likelihood"), ("all", "method")):
        printed = run(*unlimited, "--method", method)
        assert printed.returncode == 0
        first, *others = printed.stdout.splitlines()
        said = " ".join(" ".join(others).split())
        assert re.fullmatch(
            r"reliable: delay 3[56]\d\.?\d* ± \d+\.?\d* ms \(95 %: \d+\.?\d* to \d+\.?\d* ms\) "
            r"\(output_error\)",
            first,
        )
        assert re.match(
            r"The tests of the model find no contradiction at the 1 % level\. A further lag below "
            r"[\d.]+ m?s would not be seen\. quick\.csv, warning: the command stops at 1",
            said,
        ), said
        assert rest in printed.stdout
        (finding,) = found(*unlimited, "--method", method)["findings"]
        assert (finding["code"], finding["severity"]) == ("limit_seen", "warning")
        assert found(*unlimited, "--limit", 1, "--method", method)["findings"] == []
    assert "warning" not in run(*unlimited, "--limit", 1, "--method", "output_error").stdout


def test_an_indication_says_why_and_what_to_do(files):
    """A plant with the wrong lag; the advice is in the words of the command line."""
    wrong = ["estimate", files["lagging"], "--kp", 1.2, *FLOWN, *LOGGED]
    said = " ".join(run(*wrong, "--method", "output_error").stdout.split())
    assert re.match(
        r"indication: delay about [\d.]+ m?s, interval not reliable; with a further lag", said
    )
    assert "the recording is more likely, so the plant lacks a lag" in said
    assert "next: try --free delay,gain,lag" in said
    assert "±" not in said
    right = [*wrong, "--method", "output_error", "--free", "delay,gain,lag"]
    assert run(*right).stdout.startswith("reliable: ")
    out = found(*right)
    assert out["lag"] == pytest.approx(0.2, abs=0.05)
    assert out["noise_model"]["white"] == pytest.approx(0.004, rel=0.3)
    first = run("estimate", files["quick"], "--kp", 2, *FLOWN, "--method", "gcc").stdout
    assert re.match(r"indication: delay about [\d.]+ ms, interval not reliable; ", first)


def test_a_plant_with_a_time_constant_under_pi_control(files):
    """The formula of a first-order plant is one, so that its time constant can be fitted."""
    flown = ["estimate", files["first order"], "--kp", 1, "--ki", 0.5, *FLOWN, *LOGGED]
    free = ["--free", "delay,gain,time_constant", "--method"]
    for method in ("output_error", "waveform"):
        out = found(*flown, "--plant", "1/(0.5*s+1)", *free, method)
        low, high = out["interval_95"]["delay"]
        assert low < 0.3 < high
        assert out["gain"] == pytest.approx(1.2, abs=0.06)
        low, high = out["interval_95"]["time_constant"]
        assert low < 0.8 < high
    without = ["estimate", files["first order"], "--kp", 1, *FLOWN, *LOGGED, "--check"]
    assert found(*without)["recordings"][0]["law"] == "differs"


@pytest.mark.parametrize(
    ("controller", "options"),
    [
        (dtm.PV(1.2, 0.1, dtm.DerivativeFilter(20.0)), ["--kv", 0.1, "--filter", 20]),
        (dtm.PD(1.2, 0.1, dtm.DerivativeFilter(20.0)), ["--kd", 0.1, "--filter", 20]),
        (dtm.PI(1.2, 0.3), ["--ki", 0.3]),
        (
            dtm.PID(1.2, 0.3, 0.1, dtm.DerivativeFilter(20.0)),
            ["--ki", 0.3, "--kd", 0.1, "--filter", 20],
        ),
    ],
)
def test_every_controller(tmp_path, controller, options):
    plant = dtm.RationalPlant([0.9], [0.01, 0.2, 1.0, 0.0])
    loop = dtm.ControlLoop(plant, controller, delay=0.3, sample_time=0.065, limit=1.0)
    flight = dtm.Experiment.step(8.0, rest=1.04).run(loop, noise=0.004, seed=3)
    flown = ["estimate", write(flight, tmp_path / "flown.csv"), "--kp", 1.2, *options, *FLOWN]
    out = found(*flown, "--plant", "1/(s*(0.1*s+1)**2)", "--method", "waveform")
    low, high = out["interval_95"]["delay"]
    assert low < 0.3 < high
    assert out["gain"] == pytest.approx(0.9, abs=0.02)  # the factor on the formula


def test_a_delay_in_the_plant_is_part_of_the_delay(files):
    step = ["estimate", files["quick"], "--kp", 2, *FLOWN, *LOGGED, "--method", "output_error"]
    known = found(*step, "--plant", "delay(0.36)/s", "--free", "gain")
    assert known["free"] == ["gain"]
    assert known["gain"] == pytest.approx(0.9, abs=0.01)
    assert run(*step, "--plant", "delay(0.36)/s", "--free", "gain").stdout.startswith(
        "reliable: delay 360 ms, as it was given (output_error)"
    )
    fitted = found(*step, "--plant", "delay(0.1)*0.9/s")
    assert fitted["delay"] == pytest.approx(0.36, abs=0.005)


def test_a_file_may_have_a_window_of_its_own(files, tmp_path):
    both = [*FLOWN, "--method", "waveform", "--kp", 2, "--kp", 0.6]
    whole = found("estimate", files["quick"], files["slow"], *both)
    own = found("estimate", f"{files['quick']}@0.5:6", files["slow"], *both, "--window", 0, 9)
    assert own["delay"] != whole["delay"]
    assert own["delay"] == pytest.approx(0.36, abs=0.01)
    open_ended = found("estimate", f"{files['quick']}@:", files["slow"], *both)
    assert open_ended["delay"] == whole["delay"]
    checked = run("estimate", f"{files['quick']}@1:6", "--kp", 2, *FLOWN, "--check").stdout
    assert checked.startswith("quick.csv: 77 rows")
    odd = tmp_path / "odd@1:6"
    odd.write_bytes(files["quick"].read_bytes())
    assert run("estimate", odd, "--kp", 2, *FLOWN, "--check").stdout.startswith("odd@1:6: 124")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--free", "delay,mass"], "'mass' cannot be fitted; choose from delay, gain, lag"),
        (["--free", "delay,Kp"], "'Kp' cannot be fitted"),
        (["--free", ","], "names no parameter: choose from delay, gain, lag"),
        (["--free", "gain"], "the delay is not known, so it must be fitted"),
        (["--free", "delay,start"], "start can be fitted only by --method waveform"),
        (
            ["--free", "delay,time_constant"],
            "this plant has no time_constant. Only a plant gain/(time_",
        ),
        (["--plant", "1/s**2", "--free", "delay,lag"], "choose from delay, gain"),
        (["--plant", "1/(2*s+1)", "--free", "lag"], "choose from delay, gain, time_constant"),
    ],
)
def test_what_cannot_be_fitted_is_refused_always(files, more, words):
    """With --check, where all methods are compared, and where a method fits the delay alone."""
    step = ["estimate", files["quick"], "--kp", 2, *FLOWN, *more]
    for method in ([], ["--check"], ["--method", "gcc"], ["--method", "output_error"]):
        said = one_clear_line(run(*step, *method))
        assert words in said
        assert "\n" not in said


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--kp", 2, "--method", "guess"], "not one of all, auto, output_error"),
        (["--kp", 2, "--kp", 3], "1 file and 2 values of --kp"),
        (["--kp", 2, "--noise", "loop"], "--noise works with one method only"),
        (["--kp", 2, "--initial-output", 0], "--initial-output works with one method only"),
        (
            ["--kp", 2, "--method", "gcc", "--noise", "loop"],
            "--noise is not an option of --method gcc",
        ),
        (
            ["--kp", 2, "--method", "output_error", "--map", "exact"],
            "--map is not an option of --method output_error",
        ),
        (["--kp", 2, "--free", "delay"], "--free works with one method only"),
        (
            ["--kp", 2, "--method", "gcc", "--free", "delay,gain"],
            "gcc cannot fit gain. It can fit only",
        ),
        (["--kp", 2, "--filter", 20], "--filter is the filter of the derivative"),
        (["--kp", 2, "--kv", 0.1, "--ki", 0.1], "give --kv alone, or leave --kv out"),
        (["--kp", 2, "--kd", 0.1, "--kd", 0.2], "1 file and 2 values of --kd"),
        (["--kp", "nan"], "--kp is nan"),
        (["--kp", 2, "--method", "cta"], "continuous loops"),
        (["--kp", 2, "--method", "relay"], "no limit cycle"),
        (["--kp", 2, "--method", "decrement", "--free", "delay,lag"], "fix the lag"),
    ],
)
def test_invalid_combinations_of_options(files, more, words):
    assert words in one_clear_line(run("estimate", files["quick"], *FLOWN, *more))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--method", "all"], "by --method output_error or waveform"),
        (["--method", "overshoot"], "takes one recording, but 2"),
        (["--kp", 1, "--kp", 3], "2 files and 3 values of --kp"),
    ],
)
def test_invalid_combinations_of_options_for_several_files(files, more, words):
    both = ["estimate", files["quick"], files["slow"], "--kp", 2, *FLOWN]
    assert words in one_clear_line(run(*both, *more))


def test_a_window_that_is_none(files):
    said = one_clear_line(run("estimate", f"{files['quick']}@1:x", "--kp", 2, *FLOWN))
    assert "'x' is not a time. To read only a part of a file, write FILE@LOW:HIGH" in said


def test_a_reference_equal_to_the_output_is_refused(tmp_path):
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
    flight = dtm.Experiment.step(8.0, rest=1.04).run(loop)
    copied = dtm.Recording(flight.time, flight.output, flight.output, flight.command)
    file = write(copied, tmp_path / "copied.csv")
    said = one_clear_line(run("estimate", file, "--kp", 2, "--sample-time", 0.065))
    assert "reference" in said
