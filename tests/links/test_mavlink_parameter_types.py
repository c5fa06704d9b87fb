"""Integer parameters in the bits of a float, as PX4 sends them."""

import numpy as np
import pytest
from deadtime.links.mavlink.parameters import from_bits, to_bits

mavlink = pytest.importorskip("pymavlink.mavutil", reason="pymavlink has the types").mavlink

#: The integer of each type, and its extreme values.
TYPES = {
    "UINT8": np.uint8, "INT8": np.int8, "UINT16": np.uint16, "INT16": np.int16,
    "UINT32": np.uint32, "INT32": np.int32,
}  # fmt: skip


@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("value", ["least", 1, 100])
def test_an_integer_has_the_bits_of_its_type(name, value):
    kind, own = getattr(mavlink, f"MAV_PARAM_TYPE_{name}"), TYPES[name]
    number = int(np.iinfo(own).min) if value == "least" else value
    bits = np.zeros(4, dtype=np.uint8)
    raw = np.array([number], dtype=own).view(np.uint8)
    bits[: raw.size] = raw
    assert to_bits(number, kind) == float(bits.view("<f4")[0])
    assert from_bits(to_bits(number, kind), kind) == number


def test_a_float_keeps_its_value():
    assert from_bits(to_bits(0.1, mavlink.MAV_PARAM_TYPE_REAL32), 9) == 0.1
