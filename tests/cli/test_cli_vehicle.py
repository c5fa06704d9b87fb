"""`--key` and `--restore`, and that nothing foreign reaches a terminal unescaped."""

import json
import socket
import threading

import pytest
from command_line import run

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime._base.printable import printable
from deadtime._cli.show import print_json, print_text, results_table
from deadtime.links.mavlink import LinkAddress, heard_rows, read_key
from deadtime.links.mavlink.codec import Codec, dialect

KEY = bytes(range(32))


def test_a_key_is_32_bytes_or_their_digits(tmp_path):
    file = tmp_path / "key"
    for content in (KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\r\n"):
        file.write_bytes(content)
        assert read_key(file) == KEY
    for content in (b"", KEY[:-1], b"passphrase", KEY * 100, b"\xff" * 64):
        file.write_bytes(content)
        with pytest.raises(ValueError, match="no signing key"):
            read_key(file)


def test_fly_and_watch_take_a_key(tmp_path):
    (tmp_path / "key").write_bytes(KEY[:5])
    for command in (
        ("fly", "--link", "udp:127.0.0.1:1", "--folder", "new"),
        ("fly", "--link", "udp:127.0.0.1:1", "--restore"),
        ("watch", "udp:127.0.0.1:1"),
    ):
        done = run(*command, "--key", "key", cwd=tmp_path)
        assert done.returncode == 1
        assert "contains no signing key" in done.stderr
    done = run("fly", "--key", "key", cwd=tmp_path)
    assert "--key is the key that signs messages of a link" in done.stderr
    done = run("watch", "table.csv", "--key", "key", cwd=tmp_path)
    assert "is a file" in done.stderr


def test_a_watched_link_with_a_key_believes_signed_messages_only():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    codecs = [Codec(1, 1), Codec(1, 1, bytes(32)), Codec(1, 1, KEY)]
    done = threading.Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while not done.wait(0.02):
                for height, codec in enumerate(codecs, 1):
                    numbers = [0.0, 0.0, -float(height), 0.0, 0.0, 0.0]
                    message = dialect().MAVLink_local_position_ned_message(0, *numbers)
                    out.sendto(codec.encode(message), ("127.0.0.1", port))

    thread = threading.Thread(target=send)
    thread.start()
    rows = heard_rows(LinkAddress("udp", "127.0.0.1", port), "z", 5.0, KEY, system=1)
    heights = {next(rows).output for _ in range(20)}
    done.set()
    thread.join()
    assert heights == {3.0}


def test_restore_needs_a_link_and_names_a_vehicle_that_is_silent(tmp_path):
    done = run("fly", "--restore", cwd=tmp_path)
    assert "--restore needs a vehicle on a link" in done.stderr


@pytest.mark.parametrize("foreign", ["\x1b[2J", "\x07", "\x9b31m", "\u202e", "\x00", "\x7f"])
def test_nothing_foreign_reaches_a_terminal_unescaped(capsys, tmp_path, foreign):
    """ESC and BEL in the name of a file, or in what a vehicle says, were obeyed by the terminal."""
    assert printable(f"a{foreign}b\n").rstrip("\n").isprintable()
    print_text(f"a{foreign}b")
    print_json("watch", {"source": f"a{foreign}b"})
    shown = capsys.readouterr().out
    assert not set(shown) & {"\x1b", "\x07", "\x9b", "\u202e", "\x00", "\x7f"}
    assert json.loads(shown[shown.index("{") :])["source"] == f"a{foreign}b"
    assert printable(foreign) in "".join(results_table(["x"], [[foreign]]).columns[0].cells)
    if foreign != "\x00":  # no system has such a name
        done = run("estimate", f"{foreign}.csv", "--kp", 1, cwd=tmp_path)
        assert done.returncode != 0
        assert foreign not in done.stdout + done.stderr


def test_an_error_is_one_line_of_bounded_length():
    """What a user gave stood in it at any length."""
    done = run("estimate", "/".join(["folder"] * 400) + ".csv", "--kp", 1)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert len(done.stderr) < 700
