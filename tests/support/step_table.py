"""A small table of a step response, with exact numbers, for the tests of the readers."""

import numpy as np

NAMES = {"time": "t_s", "reference": "ref_m", "output": "height_m"}

#: Sixty rows with numbers of up to 17 digits, on both sides of zero.
TIME = np.arange(60) * 0.1
COLUMNS = {
    "t_s": TIME,
    "ref_m": np.where(TIME < 0.95, 0.0, 1.0),
    "height_m": np.sin(TIME) / 3.0,
    "speed": np.cos(TIME) * 1e-7,
}


def as_csv(columns=COLUMNS, delimiter=",", end="\n"):
    rows = zip(
        *(map(repr, np.asarray(column).tolist()) for column in columns.values()), strict=True
    )
    return end.join(delimiter.join(row) for row in [tuple(columns), *rows]) + end


def assert_is_the_table(recording):
    """The recording has the numbers of the table, bit for bit."""
    found = [recording.time, recording.reference, recording.output, recording.command]
    for column, values in zip(found, COLUMNS.values(), strict=True):
        assert column is None or column.tobytes() == values.tobytes()
    assert found[0].size == TIME.size
