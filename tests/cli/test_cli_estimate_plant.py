"""``deadtime estimate`` without a controller: verdict, words, exit codes, and what to run next."""

import json
import shlex

import numpy as np
import pytest
from command_line import found, one_clear_line, run
from flights import flight_path, process_path
from made_processes import DEAD, GAIN, SLOW, bump, first_order, loop_with_load, moves, sine, write

VERDICTS = ("reliable", "indication", "none")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("processes")
    time, command, output = bump()
    write(folder / "bump.csv", {"Time (s)": time, "PV": output, "OP": command})
    holed = np.where(np.random.default_rng(2).random(time.size) < 0.3, np.nan, output)
    write(folder / "holed.csv", {"Time (s)": time, "PV": holed, "OP": command})
    time, command, output = sine()
    write(folder / "sine.csv", {"t": time, "u": command, "y": output})
    write(folder / "still.csv", {"t": time, "u": np.ones(time.size), "y": output})
    rng = np.random.default_rng(3)
    deaf = rng.normal(0.0, 0.1, 150)
    write(folder / "deaf.csv", {"t": np.arange(150), "u": moves(150, 20, 1.0, rng), "y": deaf})
    return folder


def verdict_of(result):
    """The verdict that begins the output; the exit code has to say the same."""
    verdict = result.stdout.partition(":")[0]
    assert verdict in VERDICTS, result.stdout
    assert result.returncode == (3 if verdict == "none" else 0), result.stderr
    return verdict


def pasted(result, cwd):
    """Run the command that is printed, as a shell would split it; None if there is none."""
    last = result.stdout.rstrip().splitlines()[-1].strip()
    if not last.startswith("deadtime "):
        assert "next:" in result.stdout
        return None
    return run(*shlex.split(last)[1:], cwd=cwd)


def test_a_bump_test_is_answered_in_one_go(files):
    result = run("estimate", "bump.csv", cwd=files)
    assert verdict_of(result) == "reliable"
    said = " ".join(result.stdout.split())
    for words in (
        "a process that comes to rest, time constant",
        "dead time",
        "second best:",
        "in BIC",
    ):
        assert words in said
    following = pasted(result, files)
    assert following.returncode == 0, following.stderr
    assert following.stdout.startswith("PI: Kp")


def test_several_files_of_one_plant_are_fitted_together(files, tmp_path):
    time, command, output = bump(7)
    write(tmp_path / "other.csv", {"Time (s)": time, "PV": output + 3.0, "OP": command})
    asked = ("estimate", files / "bump.csv", tmp_path / "other.csv")
    result = run(*asked, "--output", "PV", "--command", "OP", cwd=tmp_path)
    assert verdict_of(result) == "reliable"
    said = " ".join(result.stdout.split())
    assert "of recording 2" in said
    assert pasted(result, tmp_path).returncode == 0
    told = found(*asked, cwd=tmp_path)
    assert len(told["recordings"]) == 2
    low, high = told["interval_95"]["delay"]
    assert low < DEAD < high


def test_json_has_the_same_answer(files):
    told = found("estimate", "bump.csv", cwd=files)
    assert told["verdict"] == "reliable"
    for name, truth in (("delay", DEAD), ("gain", GAIN), ("lag_1", SLOW)):
        low, high = told["interval_95"][name.removesuffix("_1")]
        assert low < told["parameters"][name] < high
        assert told["parameters"][name] == pytest.approx(truth, rel=0.05)
    assert told["next"].startswith("deadtime design")


def test_missing_outputs_do_not_matter(files):
    told = found("estimate", "holed.csv", cwd=files)
    assert told["verdict"] == "reliable"
    assert told["parameters"]["delay"] == pytest.approx(DEAD, abs=1.5)


def test_a_window_has_the_commands_before_it(files):
    told = found("estimate", "bump.csv", "--window", 125, 290, cwd=files)
    assert told["verdict"] != "none"
    assert told["parameters"]["delay"] == pytest.approx(DEAD, abs=3.0)


def test_one_sine_is_never_reliable_and_what_it_tells_is_said(files):
    result = run("estimate", "sine.csv", cwd=files)
    assert verdict_of(result) != "reliable"
    assert "rad/s: gain" in result.stdout
    following = pasted(result, files)
    if following is not None:
        verdict_of(following)


@pytest.mark.parametrize("name", ["still.csv", "deaf.csv"])
def test_a_record_that_tells_nothing_has_no_number_in_its_headline(name, files):
    result = run("estimate", name, cwd=files)
    assert verdict_of(result) == "none"
    headline = result.stdout.split("\n  ")[0]
    assert "dead time" not in headline
    told = run("estimate", name, "--json", cwd=files)
    assert told.returncode == 3
    assert json.loads(told.stdout)["parameters"] is None
    following = pasted(result, files)
    if following is not None:
        verdict_of(following)


def test_a_named_plant_is_fitted_and_a_better_one_is_told(files):
    result = run("estimate", "bump.csv", "--plant", "integrator", cwd=files)
    verdict_of(result)
    assert "explains the recording clearly better" in " ".join(result.stdout.split())
    named = run("estimate", "bump.csv", "--plant", "lag", cwd=files)
    assert verdict_of(named) == "reliable"
    assert "clearly better" not in named.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--ki", 1], "--ki can be used only with a known controller"),
        (["--method", "gcc"], "--method can be used only with a known controller"),
        (["--check"], "--check can be used only with a known controller"),
        (["--plant", "1/(s+1)"], "--plant 1/(s+1): without --kp, give one of 'delay', 'lag'"),
        (["--output", "T1"], "no column 'T1' for the output. Its columns are"),
        (["--window", 10, 12], "contains 3 samples"),
        (["--largest-delay", -1], "-1"),
        (
            ["--kp", 1, "--method", "gcc", "--at-rest"],
            "is chosen from the recording: leave out --at-rest, or leave out --method",
        ),
    ],
)
def test_an_error_is_a_line_with_the_value(options, words, files):
    result = run("estimate", "bump.csv", *options, cwd=files)
    assert result.returncode == 1
    assert words in one_clear_line(result)


def test_a_file_without_usual_names_lists_its_columns(tmp_path):
    time, command, output = bump(rows=100)
    write(tmp_path / "log.csv", {"when": time, "T1": output, "Q1": command})
    told = one_clear_line(run("estimate", "log.csv", cwd=tmp_path))
    for word in ("'when'", "'T1'", "'Q1'", "--time"):
        assert word in told


def test_a_name_with_blanks_can_be_pasted(tmp_path):
    time, command, output = sine()
    write(tmp_path / "a run.csv", {"t": time, "valve (%)": command, "T 1": output})
    result = run("estimate", "a run.csv", "--output", "T 1", "--command", "valve (%)", cwd=tmp_path)
    following = pasted(result, tmp_path)
    if following is not None:
        verdict_of(following)


def test_a_record_that_begins_with_its_step_is_told_to_say_rest(tmp_path):
    time = np.arange(200.0)
    command = np.where(time < 1.0, 0.0, 5.0)
    output = first_order(time, command) + np.random.default_rng(1).normal(0.0, 0.05, 200)
    write(tmp_path / "step.csv", {"t": time, "u": command, "y": output})
    result = run("estimate", "step.csv", cwd=tmp_path)
    if verdict_of(result) != "reliable":
        assert "--at-rest" in result.stdout
        assert verdict_of(pasted(result, tmp_path)) != "none"


def test_a_step_of_the_load_is_named(tmp_path):
    time, reference, output, command = loop_with_load()
    write(tmp_path / "loop.csv", {"t": time, "SP": reference, "PV": output, "OP": command})
    result = run("estimate", "loop.csv", cwd=tmp_path)
    assert verdict_of(result) == "reliable"
    assert "found: a load of" in result.stdout
    told = found("estimate", "loop.csv", cwd=tmp_path)
    assert [cause["name"] for cause in told["causes"]] == ["load"]
    low, high = told["interval_95"]["delay"]
    assert low < DEAD < high < low + 4.5


TABLES = {
    "bump.csv": (["--output", "PV", "--command", "OP"], ["reliable"]),
    "loop.csv": ([], ["reliable", "indication"]),
    "tclab_step_test.csv": (["--output", "T1", "--command", "Q1"], ["indication", "none"]),
    "window_of_slow_plant.csv": ([], ["reliable"]),
    "lagd_masked.csv": ([], ["reliable", "indication", "none"]),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(one, marks=pytest.mark.survey if one == "loop.csv" else ()) for one in TABLES],
)
def test_the_recorded_processes_are_answered_by_one_line(name, tmp_path):
    options, expected = TABLES[name]
    result = run("estimate", process_path(name), *options, cwd=tmp_path)
    assert verdict_of(result) in expected, result.stdout
    following = pasted(result, tmp_path)
    if following is not None:
        assert following.returncode in (0, 3), following.stderr


def test_the_recorded_bump_test_holds_the_truth():
    told = found("estimate", process_path("bump.csv"), "--output", "PV", "--command", "OP")
    for name, truth in (("delay", 12.0), ("gain", 1.8), ("lag", 40.0)):
        low, high = told["interval_95"][name]
        assert low < truth < high, name


@pytest.mark.survey
def test_the_recorded_loop_with_a_load_step_holds_the_dead_time_after_its_advice():
    path = process_path("loop.csv")
    told = found("estimate", path)
    assert told["verdict"] in ("reliable", "indication")
    assert told["parameters"]["delay"] == pytest.approx(12.0, abs=1.0)
    if told["next"].startswith("deadtime estimate"):
        told = found(*shlex.split(told["next"])[1:])
        low, high = told["interval_95"]["delay"]
        assert low < 12.0 < high


def test_the_recorded_heights_are_answered_with_the_gain_alone(tmp_path):
    for name, gain in (
        ("ardrone2_height_step_2_4_0_25", 2.4),
        ("ardrone2_height_step_0_5_1_0", 0.5),
    ):
        file = flight_path(f"{name}.csv")
        told = found(
            "estimate", f"{file}@13:25.5", "--time", "t_s", "--reference", "ref_m", "--output",
            "height_m", "--kp", gain, "--sample-time", 0.065, "--limit", 1, cwd=tmp_path,
        )  # fmt: skip
        assert told["verdict"] == "reliable"
        assert told["candidates"][0]["name"] == "integrator, two lags, zero"
        assert told["noise_std"] < 0.0065
        assert told["next"].startswith("deadtime design")
