"""Tables and formulas of autopilots beside other sources: pymavlink and scipy."""

import numpy as np
import pytest
from deadtime.logs import _ardupilot_modes as modes, _px4_modes as px4
from deadtime.logs._rotations import pitch_of, roll_of, yaw_of
from scipy.spatial.transform import Rotation

mavutil = pytest.importorskip("pymavlink.mavutil", reason="pymavlink has the tables")


@pytest.mark.parametrize(
    ("table", "source"),
    [
        (modes.COPTER, "mode_mapping_acm"),
        (modes.PLANE, "mode_mapping_apm"),
        (modes.ROVER, "mode_mapping_rover"),
        (modes.SUB, "mode_mapping_sub"),
    ],
)
def test_flight_modes_have_the_numbers_of_ardupilot(table, source):
    known = getattr(mavutil, source)
    both = set(table) & set(known)
    assert len(both) >= 9
    plain = {number: table[number].replace("_", "") for number in both}
    assert plain == {number: known[number].replace("_", "") for number in both}
    # A number that only one of the two has is a newer mode.
    assert all(table[number] not in known.values() for number in set(table) - both)


def test_kinds_of_vehicles_have_the_numbers_of_mavlink():
    names = {
        "fixed wing": ("FIXED_WING",), "quadrotor": ("QUADROTOR",), "coaxial": ("COAXIAL",),
        "helicopter": ("HELICOPTER",), "airship": ("AIRSHIP",), "rover": ("GROUND_ROVER",),
        "boat": ("SURFACE_BOAT",), "submarine": ("SUBMARINE",), "hexarotor": ("HEXAROTOR",),
        "octorotor": ("OCTOROTOR",), "tricopter": ("TRICOPTER",), "dodecarotor": ("DODECAROTOR",),
        "VTOL tail-sitter": (
            "VTOL_TAILSITTER_DUOROTOR", "VTOL_DUOROTOR", "VTOL_TAILSITTER_QUADROTOR",
            "VTOL_QUADROTOR", "VTOL_TAILSITTER", "VTOL_RESERVED3",
        ),
        "VTOL tiltrotor": ("VTOL_TILTROTOR",), "VTOL": ("VTOL_FIXEDROTOR", "VTOL_RESERVED2"),
    }  # fmt: skip
    expected = {}
    for name, given in names.items():
        # Later dialects have other names.
        for title in given:
            number = getattr(mavutil.mavlink, f"MAV_TYPE_{title}", None)
            if number is not None:
                expected[number] = name
    assert expected == px4.VEHICLES


def test_angles_of_quaternions_are_those_of_scipy():
    random = np.random.default_rng(7)
    x, y, z, w = Rotation.random(200, rng=random).as_quat().T
    yaw, pitch, roll = Rotation.from_quat(np.array([x, y, z, w]).T).as_euler("ZYX").T
    assert roll_of(w, x, y, z) == pytest.approx(roll, abs=1e-12)
    assert pitch_of(w, x, y, z) == pytest.approx(pitch, abs=1e-9)
    assert np.cos(yaw_of(w, x, y, z) - yaw) == pytest.approx(np.ones(200), abs=1e-12)
