"""Bags of ROS and MCAP files: their topics, and any two fields as a recording."""

import json
import pickle
import random
import subprocess
import sys
import tracemalloc

import bags
import deadtime as dtm
import numpy as np
import pytest
from command_line import found, one_clear_line, run
from deadtime.logs import is_bag, open_bag
from mutations import mutated
from small_bags import LARGEST, SMALL_BAGS, read_bag

pytest.importorskip("mcap_ros2", reason="mcap-ros2-support reads MCAP files of ROS 2")
pytest.importorskip("rosbags", reason="rosbags reads ROS bags")

MEGABYTE = 1 << 20
COMMAND, SPEED = "/cmd_vel:linear.x", "/state:speed"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A bag of each format."""
    where = tmp_path_factory.mktemp("bags")
    for name in ("zstd", "lz4", "none"):
        (where / f"{name}.mcap").write_bytes(bags.mcap(name))
    (where / "json.mcap").write_bytes(bags.mcap_json())
    bags.ros1(where / "old.bag")
    bags.ros2(where / "new")
    return where


@pytest.mark.parametrize(
    ("name", "form", "speed"),
    [
        ("zstd.mcap", "MCAP", "speed"),
        ("lz4.mcap", "MCAP", "speed"),
        ("none.mcap", "MCAP", "speed"),
        ("json.mcap", "MCAP", "speed"),
        ("old.bag", "ROS 1 bag", "vector.x"),
        ("new", "ROS 2 bag", "vector.x"),
        ("new/new.db3", "ROS 2 bag", "vector.x"),
    ],
)
def test_topics_fields_and_rates_of_each_format(folder, name, form, speed):
    assert is_bag(folder / name)
    bag = open_bag(folder / name)
    assert (bag.format, list(bag.topics), bag.remarks) == (form, ["/cmd_vel", "/state"], ())
    assert bag.start == pytest.approx(bags.FIRST / 1e9)
    assert bag.duration == pytest.approx(20.0, abs=0.1)
    command, state = bag.topics.values()
    assert (command.count, state.count) == (400, 998)
    assert (command.rate, state.rate) == pytest.approx((20.0, 50.0), rel=1e-3)
    assert (command.has_header, state.has_header) == (False, True)
    assert {"linear.x"} <= set(command.fields)
    assert {speed, "header.stamp.sec"} <= set(state.fields)
    recording = open_bag(folder / name).recording(COMMAND, f"/state:{speed}")
    sent, values, rows, measured = bags.truth()
    assert recording.time == pytest.approx(rows + bags.AGE, abs=1e-6)
    np.testing.assert_allclose(recording.output, measured)
    assert recording.sent.time == pytest.approx(sent, abs=1e-6)
    np.testing.assert_allclose(recording.sent.values, values)
    assert np.isnan(recording.reference).all()
    assert f"{COMMAND} to /state:{speed}" in recording.source
    assert "by the times of reception, because /cmd_vel has no other times" in recording.source


def test_places_in_arrays_are_fields_and_scans_are_not(folder):
    fields = open_bag(folder / "zstd.mcap").topics["/state"].fields
    assert {"place[0]", "place[1]", "place[2]"} <= set(fields)
    assert not [name for name in fields if name.startswith(("scan", "name"))]
    recording = open_bag(folder / "zstd.mcap").recording(COMMAND, SPEED, "/state:place[1]")
    assert np.array_equal(recording.reference, np.full(len(recording), 2.0))


def test_the_delay_of_the_robot_is_found_with_the_way_of_its_messages(folder):
    # Received states are older than they look: to the delay of 150 ms comes their age of 30 ms.
    recording = open_bag(folder / "zstd.mcap").recording(COMMAND, SPEED)
    sent, values = recording.sent
    step = 0.001
    grid = np.arange(sent[0], recording.time[-1], step)
    asked = values[np.searchsorted(sent, grid, side="right") - 1]
    speed = np.zeros(grid.size)
    for k in range(1, grid.size):
        speed[k] = asked[k - 1] + (speed[k - 1] - asked[k - 1]) * np.exp(-step / bags.LAG)
    delays = np.arange(0.1, 0.3, 0.002)
    left = [np.std(recording.output - np.interp(recording.time - d, grid, speed)) for d in delays]
    best = delays[int(np.argmin(left))]
    assert best == pytest.approx(bags.DELAY + bags.AGE, abs=0.003)
    # Without the times of their own, commands are taken later than they were sent.
    rows = dtm.Recording(recording.time, None, recording.output, recording.command)
    assert dtm.estimate_delay(rows).delay == pytest.approx(best - bags.ROW / 2, abs=0.003)


@pytest.mark.parametrize(
    ("header", "asked", "used", "why"),
    [
        (1.0, None, "header", "by the times in the headers, because all topics have these times"),
        (1.0, "received", "received", "by the times of reception, as the argument stamps asks"),
        (False, None, "received", "because /cmd_vel has no other times"),
        (500.0, None, "received", "because the times in the headers come from different clocks"),
        (1.0, "header", "header", "by the times in the headers, as the argument stamps asks"),
    ],
)
def test_times_of_all_topics_are_of_one_kind(tmp_path, header, asked, used, why):
    path = tmp_path / "a.mcap"
    path.write_bytes(bags.mcap_json(header, seconds=5.0))
    recording = open_bag(path).recording(COMMAND, SPEED, stamps=asked)
    assert why in recording.source
    sent, _, rows, _ = bags.truth(seconds=5.0)
    first = rows[0] if used == "header" else rows[0] + bags.AGE
    assert recording.time[0] == pytest.approx(first, abs=1e-6)
    assert recording.sent.time[0] == pytest.approx(sent[0], abs=1e-6)


@pytest.mark.parametrize(
    ("command", "output", "message"),
    [
        ("/cmd:x", SPEED, "no topic '/cmd'. Its topics are /cmd_vel, /state"),
        ("/cmd_vel:linear.w", SPEED, "no field 'linear.w'. Its fields are linear.x, linear.y"),
        ("/cmd_vel", SPEED, "fields, so one has to be named. Its fields are linear.x"),
        (COMMAND, "/state:scan[3]", r"no field 'scan\[3\]'. Its fields are header.stamp.sec"),
    ],
)
def test_a_wrong_name_is_answered_by_those_that_exist(folder, command, output, message):
    with pytest.raises(dtm.RecordingError, match=message):
        open_bag(folder / "zstd.mcap").recording(command, output)


@pytest.mark.parametrize("name", ["zstd.mcap", "old.bag", "new"])
def test_bags_can_be_copied_and_stay_read_only(folder, name):
    bag = open_bag(folder / name)
    again = pickle.loads(pickle.dumps(bag))
    assert again.to_dict() == bag.to_dict()
    field = next(iter(bag.topics["/state"].fields[-1:]))
    assert len(again.recording(COMMAND, f"/state:{field}")) == 998
    with pytest.raises(TypeError):
        bag.topics["/cmd"] = None


@pytest.mark.parametrize(("name", "library"), [("zstd.mcap", "mcap"), ("old.bag", "rosbags")])
def test_without_its_library_a_bag_names_the_line_that_installs_it(folder, name, library):
    code = (
        "import sys\n"
        f"sys.modules[{library!r}] = None\n"
        "import deadtime as dtm, deadtime.logs\n"
        f"try: deadtime.logs.open_bag({str(folder / name)!r})\n"
        "except dtm.MissingExtraError as error: print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert "pip install 'deadtime[logs]'" in done.stdout


def test_headers_that_are_missing_are_named(folder):
    with pytest.raises(dtm.RecordingError, match="the headers of /cmd_vel contain no time"):
        open_bag(folder / "zstd.mcap").recording(COMMAND, SPEED, stamps="header")


def test_what_is_no_bag_is_refused(tmp_path):
    path = tmp_path / "a.mcap"
    for data, message in (
        (b"time,x\n0,1\n", "is a text"),
        (b"\x07\x03\x01\x02", "is not a bag"),
        (b"\x89MCAP0\r\n", "without a message that can be read"),
    ):
        path.write_bytes(data)
        with pytest.raises(dtm.RecordingError, match=message):
            open_bag(path)
    with pytest.raises(dtm.RecordingError, match=r"without the file metadata\.yaml"):
        open_bag(tmp_path)
    named = tmp_path / "bag.dat"
    bags.ros1(tmp_path / "a.bag")
    (tmp_path / "a.bag").rename(named)
    with pytest.raises(dtm.RecordingError, match=r"its name does not end in \.bag"):
        open_bag(named)
    with pytest.raises(dtm.RecordingError, match=r"open it with deadtime\.logs\.open_bag"):
        dtm.open_log(named)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_a_bag_that_is_cut_off_is_read_as_far_as_it_goes(tmp_path, compression, share):
    data = bags.mcap(compression, chunk_size=10_000)
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[: int(share * len(data))])
    bag = open_bag(path)
    assert bag.remarks == ("the file is cut off or damaged, so it is read only up to this place",)
    assert 0.5 * share < bag.duration / 20.0 <= 1.0
    assert len(bag.recording(COMMAND, SPEED)) > 100


def test_inspect_lists_topics_fields_and_rates(folder):
    result = run("inspect", folder / "zstd.mcap")
    assert result.returncode == 0
    for words in (
        "zstd.mcap: MCAP, 19.99 s",
        "/cmd_vel [geometry_msgs/msg/Twist]: 400, 20 Hz",
        "/state [robot/msg/State]: 998, 50 Hz, times in its header",
        "  /state:place[2]",
    ):
        assert words in result.stdout, words
    told = found("inspect", folder / "old.bag")
    assert told["format"] == "ROS 1 bag"
    assert told["topics"][0]["count"] == 400
    assert "leave --loop" in one_clear_line(run("inspect", folder / "new", "--loop", "roll"))


def test_messages_that_cannot_be_decoded_are_named(tmp_path):
    from mcap.writer import Writer

    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        log = Writer(stream)
        log.start()
        known = log.register_channel("/known", "json", schema_id=0)
        strange = log.register_channel("/strange", "protobuf", schema_id=0)
        for k in range(20):
            log.add_message(known, k, json.dumps({"x": k}).encode(), k)
            log.add_message(strange, k, b"\x08\x01", k)
        log.finish()
    bag = open_bag(path)
    assert list(bag.topics) == ["/known"]
    assert bag.remarks == ("not decoded, because their encoding is not known: /strange",)


@pytest.mark.parametrize(
    "count", [30, pytest.param(300, marks=[pytest.mark.survey, pytest.mark.long])]
)
@pytest.mark.parametrize("name", SMALL_BAGS)
def test_damaged_bags_are_read_or_refused(name, count, tmp_path, capfd):
    draw = random.Random(19)
    ending, made = SMALL_BAGS[name]
    whole = made()
    assert len(whole) <= LARGEST
    path = tmp_path / f"a{ending}"
    path.write_bytes(whole)
    read_bag(path)  # imports the library
    read = 0
    tracemalloc.start()
    try:
        for _ in range(count):
            data = mutated(whole, draw, largest=LARGEST)
            path.write_bytes(data)
            tracemalloc.reset_peak()
            try:
                read_bag(path)
                read += 1
            except dtm.RecordingError as error:
                message = str(error)
            else:
                message = ""
            assert message.isprintable()
            assert tracemalloc.get_traced_memory()[1] < 50 * MEGABYTE + 10 * len(data)
    finally:
        tracemalloc.stop()
    assert 0.1 * count < read <= count
    assert capfd.readouterr() == ("", "")


def test_a_chunk_that_says_it_is_large_takes_no_memory(tmp_path):
    # 4 kB of zstd may hold 128 MB of zeros, and the chunk says so itself.
    zstandard = pytest.importorskip("zstandard", reason="zstandard packs the chunk")
    from mcap.records import Chunk
    from mcap.writer import RecordBuilder

    packed = zstandard.ZstdCompressor().compress(bytes(128 * MEGABYTE))
    whole = bags.mcap("zstd", chunk_size=3000, seconds=1.0)
    builder = RecordBuilder()
    for size in (128 * MEGABYTE, 100):
        Chunk("zstd", packed, 0, 0, 0, size).write(builder)
    place = 8 + 9 + int.from_bytes(whole[9:17], "little")
    path = tmp_path / "a.mcap"
    path.write_bytes(whole[:place] + builder.end() + whole[place:])
    tracemalloc.start()
    try:
        bag = open_bag(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 50 * MEGABYTE
    assert list(bag.topics) == ["/cmd_vel", "/state"]
    assert bag.remarks == ("2 damaged chunks are left out",)
