"""Defects of a command show a traceback, users' errors one line; any terminal can show the text."""

import json
import os
import subprocess
import sys

import deadtime as dtm
import pytest
from made_logs import copter

RUN = "from deadtime._cli import main; main()"
MADE_READABLE = "from deadtime._cli.readable import make_readable\nmake_readable()\n"


def command(*arguments, before="", cwd=None, **environment):
    code = f"import sys\nsys.argv[1:] = {list(arguments)!r}\n{before}\n{RUN}"
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        timeout=120,
        check=False,
        cwd=cwd,
        env={**os.environ, "COLUMNS": "160", "NO_COLOR": "1", **environment},
    )


def ended(monkeypatch, capsys, error):
    """Exit code and standard error of a command that raises this error."""
    from deadtime._cli import app

    def fails():
        raise error

    monkeypatch.setattr(app, "app", fails)
    with pytest.raises(SystemExit) as end:
        app.run()
    return end.value.code, capsys.readouterr().err


@pytest.mark.parametrize(
    "error",
    [TypeError("a + b"), RuntimeError("odd"), AttributeError("x"), AssertionError(),
     KeyError("x"), IndexError("x")],
)  # fmt: skip
def test_a_defect_shows_where_it_is_and_asks_to_be_reported(error, monkeypatch, capsys):
    # A TypeError of our own was one friendly line without a place.
    code, said = ended(monkeypatch, capsys, error)
    assert code == 70
    assert "Traceback" in said
    assert "in fails" in said
    assert "Please report it" in said.splitlines()[-1]


@pytest.mark.parametrize(
    "error",
    [ValueError("a number"), OSError(28, "No space left on device", "a.csv"),
     dtm.RecordingError("a row"), dtm.FlightAbortedError("too high"), OverflowError("far"),
     MemoryError("the map needs 3 GiB")],
)  # fmt: skip
def test_an_error_of_the_user_is_one_line(error, monkeypatch, capsys):
    code, said = ended(monkeypatch, capsys, error)
    assert code == 1
    assert len(said.strip().splitlines()) == 1
    assert said.startswith("deadtime: ")


def test_a_memory_error_names_the_size(monkeypatch, capsys):
    said = ended(monkeypatch, capsys, MemoryError("the map needs 3 GiB"))[1]
    assert "the map needs 3 GiB" in said


def test_a_missing_extra_is_named_with_the_line_that_installs_it(monkeypatch, capsys):
    said = ended(monkeypatch, capsys, dtm.MissingExtraError("pip install 'deadtime[plot]'"))[1]
    assert said == "deadtime: pip install 'deadtime[plot]'\n"


def test_a_failure_is_one_line_and_the_exit_code_of_the_process(tmp_path):
    done = command("estimate", "none.csv", "--kp", "2", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, b"")
    assert done.stderr.decode().startswith("deadtime: ")
    assert len(done.stderr.splitlines()) == 1


def test_commands_are_readable_in_latin_1():
    before = "print('Td ≤ 0.36 s → σ = −0.5 ± 0.1 1/s, √2 … • ŷ')"
    done = command("roots", "--kp", "2", "--delay", "0.36", before=MADE_READABLE + before,
                   PYTHONIOENCODING="latin-1", LC_ALL="C")  # fmt: skip
    assert done.returncode == 0, done.stderr
    shown = done.stdout.decode("latin-1")
    assert shown.startswith("Td <= 0.36 s -> sigma = -0.5 ± 0.1 1/s, sqrt2 ... * y\n")
    assert "Re s" in shown


def test_json_on_a_poor_terminal_is_the_same_json():
    before = (
        "from deadtime._cli.show import print_json\n"
        f"{MADE_READABLE}"
        "print_json('any', {'where': 'σ → ω', 'n': 1.5})\n"
        "sys.exit()"
    )
    poor = command(before=before, PYTHONIOENCODING="ascii").stdout
    rich = command(before=before, PYTHONIOENCODING="utf-8").stdout
    expected = {"schema": "deadtime.any/1", "where": "σ → ω", "n": 1.5}
    assert json.loads(poor) == json.loads(rich) == expected


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["inspect", "{}"],
        pytest.param(["inspect", "{}", "--json"], marks=pytest.mark.survey),
    ],
)
def test_a_reader_that_closes_the_output_gets_its_lines_and_no_complaint(arguments, tmp_path):
    path = tmp_path / "flight.bin"
    path.write_bytes(copter().data)
    arguments = [one.format(path) for one in arguments]
    code = f"import sys\nsys.argv[1:] = {arguments!r}\n{RUN}"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    environment = {**os.environ, "COLUMNS": "160", "NO_COLOR": "1"}
    with subprocess.Popen([sys.executable, "-c", code], env=environment, **pipes) as process:
        assert process.stdout.readline().strip()
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(60) in (0, 1)
