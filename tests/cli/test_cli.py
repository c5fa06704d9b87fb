"""The command: what it prints, what it writes, and one line for each error."""

import os
import re
import subprocess
import sys

import pytest
from browser import check_page
from command_line import found, one_clear_line, run
from deadtime.roots import Certificate
from flights import flight_path

DEADTIME = [sys.executable, "-m", "deadtime"]
COLUMNS = ["--time", "t_s", "--reference", "ref_m", "--output", "height_m"]
FLOWN = ["--sample-time", "0.065", "--limit", "1", "--window", "13", "25.5"]


def process(*arguments, cwd=None, **environment):
    """The command as a process of its own: the entry, its exit code, its terminal."""
    return subprocess.run(
        [*DEADTIME, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=cwd,
        env={**os.environ, "COLUMNS": "160", "NO_COLOR": "1", **environment},
    )


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    # A process of its own, on a terminal that has no more than ASCII.
    result = process("demo", cwd=folder, PYTHONIOENCODING="ascii", LC_ALL="C")
    assert result.returncode == 0, result.stderr
    return folder, result.stdout


@pytest.fixture(scope="module")
def all_of_demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("all")
    result = process("demo", "--all", cwd=folder, PYTHONIOENCODING="ascii", LC_ALL="C")
    assert result.returncode == 0, result.stderr
    return folder, result.stdout


def test_the_demo_is_a_paragraph_that_names_the_truth_once(demo):
    _, printed = demo
    assert printed.count("0.402") == 1
    assert "Reliable: the delay of the loop is 0.40" in printed
    # The limit of the true loop under proportional control is 5.0; half of it is called safe.
    assert "keep Kp below 2.5" in printed
    assert "Try Kp" in printed
    assert "inf" not in printed
    assert "paper" not in printed
    last = printed.rstrip().splitlines()[-2:]
    assert last == ["open demo/report.html", "To use your own file: deadtime estimate FILE"]


def test_all_methods_of_the_demo_are_shown_where_asked_for(all_of_demo):
    _, printed = all_of_demo
    assert "the truth" in printed
    for method in ("paper", "exact", "with limit", "waveform with lag"):
        assert method in printed
    # On this ASCII terminal, where a bullet and a minus once ended it with exit code 1.
    assert "?" not in printed


def test_the_demo_writes_a_flight_and_a_self_contained_report(demo):
    folder, _ = demo
    assert (folder / "demo" / "flight.csv").read_text().startswith("t_s,ref_m,height_m\n")
    page = (folder / "demo" / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 3
    assert "the truth" in page
    # nothing is fetched: addresses only name XML vocabularies and parts of the pictures
    assert "<script" not in page
    assert page.count("<link") == page.count('<link rel="icon" href="data:,">')
    assert 'src="' not in page


def test_the_report_is_valid_and_says_what_its_pictures_show(demo):
    folder, _ = demo
    page = (folder / "demo" / "report.html").read_text(encoding="utf-8")
    # The explorer is a page of its own, in a frame.
    page, frames = re.subn(r"<iframe .*?</iframe>", "", page, flags=re.DOTALL)
    assert frames == 1
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names)), "two parts of the page have one name"
    used = re.findall(r'(?:href="#|url\(#|aria-labelledby=")([^")]+)', page)
    assert used
    assert set(used) <= set(names)
    assert page.count('role="img"') == 3
    assert '<html lang="en">' in page
    assert '<th scope="col">' in page


@pytest.mark.survey
def test_the_report_in_a_browser(demo):
    check_page(demo[0] / "demo" / "report.html")


def test_a_narrow_terminal_leaves_out_no_digits(demo, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    folder, _ = demo
    file = folder / "demo" / "flight.csv"
    narrow = run("estimate", file, *COLUMNS, "--kp", 2.4, *FLOWN, "--method", "all").stdout
    assert "…" not in narrow
    assert "waveform with lag" in narrow


def test_the_three_commands_that_the_demo_prints_run(all_of_demo):
    folder, printed = all_of_demo
    lines = [line.split() for line in printed.splitlines() if line.startswith("deadtime ")]
    assert len(lines) == 3
    for line in lines:
        result = run(*line[1:], cwd=folder)
        assert result.returncode == 0, result.stderr
    assert "<svg" in (folder / "demo" / "again.html").read_text(encoding="utf-8")


def test_a_real_flight_by_both_methods():
    file = flight_path("ardrone2_height_step_2_4_0_25.csv")
    out = found("estimate", file, *COLUMNS, "--kp", 2.4, *FLOWN, "--method", "all")
    assert out["estimates"]["dominant"]["delay"] == pytest.approx(0.339, abs=0.01)
    fit = out["estimates"]["waveform"]
    assert 0.42 <= fit["delay"] <= 0.44
    assert 0.74 <= fit["gain"] <= 0.76
    assert fit["verdict"] == "indication"
    low, high = fit["interval_95"]["delay"]
    assert high - low > 0.04  # the robust one; the naive one is 0.014 wide
    said = " ".join(out["explanation"])
    assert "differ" in said
    assert "assumes a gain of 1, but the gain is" in said
    assert (
        "The fit without a further lag is only an indication: the residuals are not white" in said
    )


def test_a_real_flight_without_overshoot():
    file = flight_path("ardrone2_height_step_0_5_1_0.csv")
    out = found("estimate", file, *COLUMNS, "--kp", 0.5, *FLOWN, "--method", "all")
    assert "no overshoot" in out["refusals"]["dominant"]
    low, high = out["estimates"]["waveform"]["interval_95"]["delay"]
    assert high - low > 0.1
    refused = run("estimate", file, *COLUMNS, "--kp", 0.5, *FLOWN, "--method", "overshoot")
    assert refused.returncode == 3
    assert "no overshoot" in refused.stderr


def test_roots_of_the_papers_loop():
    out = found("roots", "--kp", 2, "--kv", 0.3, "--delay", 0.36)
    assert out["spectral_abscissa"] == pytest.approx(-3.3168, abs=5e-5)
    assert out["chain_abscissa"] == pytest.approx(-3.3444, abs=5e-5)
    region = found("roots", "--kp", 2, "--delay", 0.36, "--re", -12, 2, "--im", 0, 100)
    assert region["counted"] == 6
    assert "\nunstable: a root at 0.270041" in run("roots", "--kp", 5, "--delay", 0.36).stdout


def test_a_map_and_its_picture(tmp_path):
    out = found("map", "--delay", 0.36, "--shape", 21, 21)
    assert len(out["abscissa"]) == 21
    assert out["best_abscissa"] < -2
    for suffix in ("png", "svg"):
        picture = tmp_path / f"map.{suffix}"
        result = run("map", "--delay", 0.36, "--shape", 21, 21, "--plot", picture)
        assert result.returncode == 0, result.stderr
        assert picture.stat().st_size > 1000


def test_a_design(tmp_path):
    stable = ("--objective", "abscissa")
    out = found("design", "--delay", 0.36, "--kp", 1, 4, "--kv", 0, 0.9, *stable)
    assert out["abscissa"] < -3.684
    robust = found("design", "--delay", 0.3, "--delay-to", 0.4, "--sample-time", 0.065)
    assert robust["abscissa"] < 0
    assert robust["objective"] == "load"
    assert robust["margins"]["max_sensitivity"] == pytest.approx(1.6, rel=1e-6)
    assert robust["delays"] == [0.3, pytest.approx(0.35), 0.4]
    picture = tmp_path / "design.png"
    fixed = found(
        "design", "--delay", 0.36, "--fix", "Kp=2", "--filter", 38, "--gain-margin", 2.25,
        "--plot", picture, *stable,
    )  # fmt: skip
    assert fixed["gains"]["Kp"] == 2.0
    assert fixed["margins"]["gain_margin"] >= 2.25
    assert "limits the design" in fixed["traded"]["gain_margin"]
    assert picture.stat().st_size > 5000
    chosen = found("design", "--delay", 0.36, "--fix", "Kp=2", "--choose-filter")
    assert 100 < chosen["filter"] < 200
    alone = run("design", "--delay", 0.36, "--controller", "P").stdout
    assert "least margins: gain" in alone
    assert "(1 scenario checked; proved: stable)" in alone


def test_a_simulation_and_its_file(tmp_path):
    file = tmp_path / "step.csv"
    out = found("simulate", "--kp", 1.31, "--delay", 0.36, "--out", file)
    # the command path delays the paper's response by 0.36 s; its overshoot stays 2.38 %
    assert out["info"]["overshoot"] == pytest.approx(2.38, abs=0.01)
    lines = file.read_text().splitlines()
    assert lines[0] == "time_s,reference,output,command"
    assert len(lines) == 502


@pytest.mark.parametrize("command", ["estimate", "report"])
@pytest.mark.parametrize(
    ("content", "words"),
    [(None, "does not exist"), (b"", "is empty"), (bytes(range(256)) * 4, "neither a text file")],
)
def test_files_that_cannot_be_read(tmp_path, command, content, words):
    file = tmp_path / "flight.csv"
    if content is not None:
        file.write_bytes(content)
    said = one_clear_line(run(command, file, *COLUMNS, "--kp", 2.4, cwd=tmp_path))
    assert said.startswith("deadtime: ")
    assert words in said
    assert len(said.splitlines()) == 1


BAD_NUMBERS = [
    (["roots", "--kp", "2", "--delay", "-0.1"], "delay"),
    (["roots", "--kp", "0", "--delay", "0.1"], "Kp"),
    (["roots", "--kp", "nan", "--delay", "0.1"], "nan"),
    (["roots", "--kp", "2", "--delay", "nan"], "delay"),
    (["roots", "--kp", "2", "--delay", "inf"], "delay"),
    (["roots", "--kp", "2", "--delay", "0.1", "--gain", "0"], "gain"),
    (["roots", "--kp", "2", "--delay", "0.1", "--re", "0", "1"], "--im"),
    (["roots", "--kp", "2", "--delay", "0.1", "--re", "1", "0", "--im", "0", "1"], "re"),
    (["map", "--delay", "-0.1"], "delay"),
    (["map", "--delay", "nan"], "delay"),
    (["map", "--delay", "0.1", "--gain", "0"], "gain"),
    (["map", "--delay", "0.1", "--kp", "nan", "1"], "Kp"),
    (["map", "--delay", "0.1", "--plot", "map.txt"], ".png"),
    (["design", "--delay", "-0.1"], "delay"),
    (["design", "--delay", "nan"], "delay"),
    (["design", "--delay", "0.1", "--gain", "0"], "gain"),
    (["design", "--delay", "0.1", "--fix", "2"], "Kp=2"),
    (["design", "--delay", "0.1", "--fix", "Ki=2"], "Ki"),
    (["design", "--delay", "0.1", "--gain-margin", "0.5"], "gain_margin"),
    (["design", "--delay", "0.1", "--filter", "38", "--choose-filter"], "give only one of the two"),
    (["simulate", "--kp", "2", "--delay", "-1"], "delay"),
    (["simulate", "--kp", "0", "--delay", "1"], "Kp"),
    (["simulate", "--kp", "nan", "--delay", "1"], "nan"),
    (["simulate", "--kp", "2", "--delay", "1", "--sample-time", "0"], "sample_time"),
    (["simulate", "--kp", "2", "--delay", "1", "--limit", "-1"], "limit"),
    (["simulate", "--kp", "2", "--delay", "1", "--duration", "nan"], "duration"),
    (["simulate", "--kp", "2"], "delay"),
    (["demo", "--seed", "-1"], "seed"),
    (["fly", "--gains", "nan"], "Kp"),
    (["hover"], "hover"),
]


@pytest.mark.parametrize(("arguments", "words"), BAD_NUMBERS)
def test_invalid_numbers_are_refused(tmp_path, arguments, words):
    assert words in one_clear_line(run(*arguments, cwd=tmp_path))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--kp", "0"], "Kp"),
        (["--kp", "nan"], "nan"),
        (["--gain", "0"], "gain"),
        (["--sample-time", "-1"], "sample_time"),
        (["--limit", "nan"], "limit"),
        (["--window", "5", "2"], "low below high"),
        (["--window", "500", "600"], "0 samples"),
        (["--output", "altitude"], "no column"),
        (["--method", "waveform", "--free", "mass"], "mass"),
        (["--command", "u"], "no column"),
    ],
)
def test_invalid_options_of_estimate_are_refused(demo, more, words):
    folder, _ = demo
    Kp = [] if "--kp" in more else ["--kp", "2.4"]
    arguments = ["estimate", folder / "demo" / "flight.csv", *COLUMNS, *Kp, *more]
    assert words in one_clear_line(run(*arguments))


def test_a_file_that_cannot_be_written(demo):
    folder, _ = demo
    missing = folder / "nowhere" / "step.csv"
    said = one_clear_line(run("simulate", "--kp", 2, "--delay", 0.3, "--out", missing))
    assert "nowhere" in said


def test_without_its_extras_it_says_how_to_get_them():
    code = "import sys; sys.modules['typer'] = None; from deadtime._cli import main; main()"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 1
    assert "pip install 'deadtime[cli]'" in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize(
    "command", ["estimate", "roots", "map", "design", "simulate", "report", "demo"]
)
def test_every_command_explains_itself(command):
    result = run(command, "--help")
    assert result.returncode == 0
    assert "--json" in result.stdout


def test_the_proof_of_the_roots_is_filed(tmp_path):
    proof, picture = tmp_path / "proof.json", tmp_path / "roots.png"
    out = found(
        "roots", "--kp", 2, "--kv", 0.3, "--delay", 0.36, "--re", -6, 2, "--im", -60, 60,
        "--certificate", proof, "--plot", picture,
    )  # fmt: skip
    read = Certificate.from_json(proof.read_text(encoding="utf-8"))
    assert read.verify() == out["counted"] == 7
    assert picture.stat().st_size > 5000
