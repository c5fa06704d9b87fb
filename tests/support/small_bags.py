"""Small bags to damage: MCAP files of ROS 2 and of JSON, packed and not, and bags of ROS."""

import tempfile
from pathlib import Path

import bags

#: Bags are larger than small logs: their definitions are texts, and a database has pages.
LARGEST = 32_768

SECONDS = 0.5


def _written(write, name, file):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path, seconds=SECONDS)
        return (path / file if file else path).read_bytes()


def _mcap(compression):
    return bags.mcap(compression, chunk_size=3000, seconds=SECONDS)


#: By format: the ending of its name, and what makes its bytes.
SMALL_BAGS = {
    "MCAP packed by zstd": (".mcap", lambda: _mcap("zstd")),
    "MCAP packed by lz4": (".mcap", lambda: _mcap("lz4")),
    "MCAP": (".mcap", lambda: _mcap("none")),
    "MCAP of JSON": (".mcap", lambda: bags.mcap_json(seconds=SECONDS)),
    "ROS 1 bag": (".bag", lambda: _written(bags.ros1, "a.bag", "")),
    "ROS 2 bag": (".db3", lambda: _written(bags.ros2, "a", "a.db3")),
}


def read_bag(path):
    """All that a damaged bag is asked for: its topics, and a recording of two fields."""
    from deadtime.logs import open_bag

    bag = open_bag(path)
    assert all(line.isprintable() for line in bag.summary().split("\n"))
    assert bag.to_dict()["format"]
    names = [f"{topic.name}:{path}" for topic in bag.topics.values() for path in topic.fields]
    for name in names[:1]:
        bag.recording(name, names[-1])
