"""``deadtime fly`` as a command: with an emulator of its own, and its reactions to signals."""

import asyncio
import contextlib
import csv
import json
import os
import signal
import socket
import subprocess
import sys
import time

import pytest
from browser import check_page
from command_line import run
from deadtime._cli.fly import _free_folder
from deadtime.flights._step_test import HEIGHT, row_columns
from deadtime.links import run_landing, terminated_like_interrupted
from deadtime.links.ardrone2.emulator import Phase
from emulated import emulator, skip_if_too_busy

FLY = [sys.executable, "-m", "deadtime", "fly"]


def run_fly(*options):
    return run("fly", *options)


def running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fly") / "new" / "flight"
    done = run_fly("--virtual-time", "--folder", folder, "--seed", 3, "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


@pytest.mark.survey
def test_the_whole_experiment_in_virtual_time(whole):
    folder, whole_result = whole
    assert whole_result["flown_on"] == "an emulated AR.Drone 2.0 (kit)"
    result = whole_result["axes"]["z"]
    assert 0.33 < result["overshoot_method"][1] < 0.38
    assert result["fit"]["delay_plus_lag"] == pytest.approx(0.405, abs=0.01)
    assert result["transport"]["delay"] == pytest.approx(0.26, abs=0.01)
    assert result["vehicle_delay"] == pytest.approx(0.142, abs=0.015)
    low, high = result["vehicle"]["interval_95"]["time_constant"]
    assert low < result["vehicle_delay"] < high
    last = result["flights"][-1]
    assert last["overshoot"] < 5.0
    assert last["settling_time"] < min(one["settling_time"] for one in result["flights"][:-1])
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 3
    assert result["verdict"].split(".")[0] in page
    assert json.loads((folder / "result.json").read_text(encoding="utf-8")) == whole_result
    again = run_fly("--virtual-time", "--folder", folder)
    assert again.returncode == 1
    assert "contains recordings already" in again.stderr


@pytest.mark.survey
def test_its_page_in_a_browser(whole):
    check_page(whole[0] / "report.html")


def test_a_real_host_needs_consent_and_shows_the_limits():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
        drone.bind(("127.0.0.1", 0))
        drone.settimeout(0.3)
        port = drone.getsockname()[1]
        done = run_fly("--host", "127.0.0.1", "--navdata-port", port, "--command-port", port)
        with pytest.raises(TimeoutError):
            drone.recvfrom(1)
    assert done.returncode == 1
    assert "--i-have-a-safe-area" in done.stderr
    assert "nothing was sent" in done.stderr
    # The default of a real drone's largest climb is half a metre a second.
    assert "no more than 0.5 m/s" in done.stderr
    assert "4 flights" in done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--gains", "1.2,3"), "Kp = 3 is above 2.47"),
        (("--gains", "fast"), "numbers with commas"),
        (("--gains", ""), "gains is empty"),
        (("--max-height", "1.2"), "outside of 0.2 to 1.2 m"),
        (("--host", "127.0.0.1", "--virtual-time"), "leave out --virtual-time"),
        (("--max-climb", "nan"), "max_climb"),
        (("--axes", "z,w"), "give some of z, x, y, yaw"),
        (("--gains", "x=1"), "the axis x is not in --axes"),
        (("--axes", "x", "--virtual-time"), "accepts no speed commands on the axis x, only on z"),
        (("--step", "-0.2"), "step"),
        (("--step", "1e-5"), "as small as the noise"),
        (("--step", "0.95", "--base", "1.5", "--max-height", "4"), "a step of 0.9 m or less"),
    ],
)
def test_unsafe_or_invalid_options_are_refused(options, message, tmp_path):
    done = run_fly("--folder", tmp_path, *options)
    assert done.returncode == 1
    assert message in " ".join(done.stderr.split())
    assert list(tmp_path.iterdir()) == []


def test_the_folder_is_the_first_that_holds_no_flight(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert str(_free_folder()) == "flight"
    (tmp_path / "flight").mkdir()
    assert str(_free_folder()) == "flight"
    (tmp_path / "flight" / "flight-1-z-P.csv").touch()
    assert str(_free_folder()) == "flight-2"
    (tmp_path / "flight-2").touch()
    assert str(_free_folder()) == "flight-3"


def read_rows(path):
    """The rows of a recording, each of which must be complete."""
    with path.open(newline="") as stream:
        head, *rows = csv.reader(stream)
    assert tuple(head) == row_columns(HEIGHT)
    assert all(len(row) == len(head) for row in rows)
    return rows


# These tests may run under `nohup`, which the command would respect, so SIGHUP is reset first.
HEEDING_SIGHUP = [
    sys.executable,
    "-c",
    "import os, signal, sys\n"
    "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"
    "os.execv(sys.argv[1], sys.argv[1:])",
]

ENDING = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


@pytest.fixture
def handlers():
    """Default signal handlers, even where a shell has made the process ignore Ctrl-C."""
    before = {number: signal.getsignal(number) for number in ENDING}
    for number in ENDING:
        plain = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
        signal.signal(number, plain)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", ENDING)
def test_each_signal_cancels_the_experiment_and_works_again_afterwards(number, handlers):
    async def fly():
        for _ in range(3):  # Some code on the way has suppressed the first cancellations.
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(5.0)
                raise AssertionError("nothing came")
            os.kill(os.getpid(), number)
        await asyncio.sleep(5.0)

    async def begin():
        os.kill(os.getpid(), number)
        await fly()

    with terminated_like_interrupted():
        with pytest.raises(KeyboardInterrupt):
            run_landing(begin())
        # Between two flights, while gains are designed.
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)


def test_a_signal_ignored_under_nohup_stays_ignored(handlers):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)

    async def fly():
        os.kill(os.getpid(), signal.SIGHUP)
        await asyncio.sleep(0.01)
        return "landed"

    with terminated_like_interrupted():
        assert run_landing(fly()) == "landed"


class LoopWithoutSignals(asyncio.SelectorEventLoop):
    """An event loop without signal handlers, as on Windows."""

    def add_signal_handler(self, *given):
        raise NotImplementedError

    def remove_signal_handler(self, *given):
        raise NotImplementedError


def test_without_signal_handlers_of_the_event_loop_those_of_the_interpreter_are_used(
    handlers, monkeypatch, capsys
):
    # The event loops of Windows have no `add_signal_handler`.
    monkeypatch.delattr(signal, "SIGHUP")
    monkeypatch.setattr(asyncio.events, "new_event_loop", LoopWithoutSignals)
    landed = []

    async def fly():
        assert isinstance(asyncio.get_running_loop(), LoopWithoutSignals)
        try:
            os.kill(os.getpid(), signal.SIGINT)
            await asyncio.sleep(10.0)
        except asyncio.CancelledError:
            landed.append(True)
            raise

    before = signal.getsignal(signal.SIGINT)
    with terminated_like_interrupted(), pytest.raises(KeyboardInterrupt):
        run_landing(fly())
    assert landed
    assert "landing first" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(signal.SIGINT, marks=pytest.mark.survey),
        pytest.param(signal.SIGHUP, marks=pytest.mark.survey),
        signal.SIGTERM,
    ],
)
def test_a_signal_lands_the_drone_and_keeps_the_rows(number, tmp_path):
    async def fly():
        async with emulator(host="127.0.0.1") as emulated:
            ports = ("navdata_port", "command_port", "control_port")
            options = [f"--{name.replace('_', '-')}={getattr(emulated, name)}" for name in ports]
            process = await asyncio.create_subprocess_exec(
                *HEEDING_SIGHUP,
                *FLY,
                *("--host", "127.0.0.1", "--i-have-a-safe-area", "--folder", str(tmp_path)),
                *options,
                stderr=asyncio.subprocess.PIPE,
            )
            recording = tmp_path / "flight-1-z-P.csv"
            try:
                for _ in range(600):
                    await asyncio.sleep(0.05)
                    if recording.exists() and len(recording.read_text().splitlines()) > 15:
                        break
                if process.returncode is not None:
                    skip_if_too_busy((await process.communicate())[1].decode())
                assert emulated.truth().phase is Phase.FLYING
                process.send_signal(number)
                await asyncio.sleep(0.5)
                assert emulated.truth().phase is Phase.LANDING
                process.send_signal(number)  # A second signal does not end the landing.
                _, error = await asyncio.wait_for(process.communicate(), 20.0)
                assert emulated.truth().phase is Phase.LANDED
                assert process.returncode == 130
                assert "landing first" in error.decode()
                assert "kept in" in error.decode()
                assert len(read_rows(recording)) > 14
            finally:
                if process.returncode is None:
                    process.kill()
                    await process.communicate()

    asyncio.run(fly())


def own_emulators(parent):
    """Processes started by a process."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{entry}/stat", encoding="utf-8") as stat:
                fields = stat.read().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[1]) == parent:
            found.append(int(entry))
    return found


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="processes are looked up in /proc")
@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGTERM, marks=pytest.mark.survey), signal.SIGKILL]
)
def test_the_emulator_that_the_command_starts_ends_with_it(number, tmp_path):
    process = subprocess.Popen([*FLY, "--folder", str(tmp_path)], stderr=subprocess.DEVNULL)
    children = []
    for _ in range(200):
        children = own_emulators(process.pid)
        if children and list(tmp_path.glob("flight-1-z-P.csv")):
            break
        time.sleep(0.1)
    assert children
    process.send_signal(number)
    process.wait(20.0)
    for _ in range(100):
        if not any(map(running, children)):
            break
        time.sleep(0.1)
    assert not any(map(running, children))
