"""What the commands state about a loop: the roots they list, and only metrics that exist."""

import json

import pytest
from deadtime._cli.app import app
from typer.testing import CliRunner


def printed(line):
    result = CliRunner().invoke(app, line.split(), env={"COLUMNS": "200", "NO_COLOR": "1"})
    assert result.exit_code == 0, result.output
    return " ".join(result.stdout.split())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        # Three were promised and one was listed, without a word.
        (
            "--kp 2 --kv 0.3 --delay 0.36",
            "1 root instead of the 3 that were asked for. The list is proved to be complete",
        ),
        ("--kp 2 --delay 0.36", "6 roots. The list is proved to be complete right of Re s = -8.79"),
        (
            "--kp 2 --delay 0.36 --rightmost 1",
            "2 roots. The list is proved to be complete right of",
        ),
        ("--kp 2 --delay 0", "1 root. The list is proved to be complete"),
        ("--kp 6 --delay 0.36 --re -1 -0.5 --im 0 1", "0 roots in re=(-1, -0.5), im=(0, 1)"),
        ("--kp 2 --delay 0.36", "stable: spectral abscissa -1.51536"),
        ("--kp 6 --delay 0.36", "unstable: a root at 0.634054 ± 4.73323j"),
        ("--kp 6 --delay 0.36 --sample-time 0.065", "unstable: a root at 0.726307"),
        # On the axis to the last bit: neither is proved.
        ("--kp 4.363323129985824 --delay 0.36", "not proved stable"),
    ],
)
def test_the_list_of_roots_says_how_many_there_are_and_where(line, words):
    assert words in printed(f"roots {line}")


def test_an_unstable_loop_has_no_steady_state():
    # It had an overshoot of 3.9e8 % and a steady state of 1.
    line = "simulate --kp 8 --delay 0.36 --duration 20"
    shown = printed(line)
    assert shown.startswith("the loop is unstable: a root at 1.2143 ± 5.02229j grows")
    assert "peak time" in shown
    assert "overshoot" not in shown
    assert "steady" not in shown
    found = json.loads(CliRunner().invoke(app, [*line.split(), "--json"]).stdout)
    assert found["stable"] is False
    assert found["info"]["steady_state"] is None
    assert found["info"]["overshoot"] is None
    assert found["info"]["peak"] > 1e9


def test_a_limit_bounds_the_response_and_not_the_judgement():
    shown = printed("simulate --kp 8 --delay 0.36 --limit 1")
    assert shown.startswith("the loop (the limit of the command is ignored) is unstable")
    assert "steady" not in shown


def test_a_stable_loop_that_is_watched_too_short_a_time():
    shown = printed("simulate --kp 2 --delay 0.36 --duration 0.2")
    assert shown.startswith("the loop is stable")
    assert "settling time not within the simulated time" in shown
