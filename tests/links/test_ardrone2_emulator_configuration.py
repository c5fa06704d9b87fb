"""The emulated AR.Drone 2.0 without sockets: its configuration, and hostile input."""

import asyncio
import math

import numpy as np
import pytest
from deadtime import links
from deadtime.links.ardrone2.commands import (
    Config,
    ConfigIds,
    Control,
    Move,
    Watchdog,
    encode,
)
from deadtime.links.ardrone2.configuration import parse_configuration
from deadtime.links.ardrone2.emulator import (
    Drone,
    Emulator,
    EmulatorOptions,
    Phase,
)
from deadtime.links.ardrone2.navdata import parse_navdata
from hypothesis import given, settings, strategies as st
from pilot import COMMANDS, NAVDATA, UP, WAKE, Pilot, configured

#: The keys of the developer guide of the SDK 2.0.
DOCUMENTED = [
    f"{section}:{name}"
    for section, names in {
        "general": "num_version_config num_version_mb num_version_soft drone_serial "
        "soft_build_date motor1_soft motor1_hard motor1_supplier motor2_soft motor2_hard "
        "motor2_supplier motor3_soft motor3_hard motor3_supplier motor4_soft motor4_hard "
        "motor4_supplier ardrone_name flying_time navdata_demo navdata_options com_watchdog "
        "video_enable vision_enable vbat_min",
        "control": "accs_offset accs_gains gyros_offset gyros_gains gyros110_offset gyros110_gains "
        "magneto_offset magneto_radius gyro_offset_thr_x gyro_offset_thr_y gyro_offset_thr_z "
        "pwm_ref_gyros osctun_value osctun_test altitude_max altitude_min control_level "
        "euler_angle_max control_iphone_tilt control_vz_max control_yaw outdoor "
        "flight_without_shell autonomous_flight manual_trim indoor_euler_angle_max "
        "indoor_control_vz_max indoor_control_yaw outdoor_euler_angle_max outdoor_control_vz_max "
        "outdoor_control_yaw flying_mode hovering_range flight_anim",
        "network": "ssid_single_player ssid_multi_player wifi_mode wifi_rate owner_mac",
        "pic": "ultrasound_freq ultrasound_watchdog pic_version",
        "video": "camif_fps codec_fps camif_buffers num_trackers video_codec video_slices "
        "video_live_socket video_storage_space bitrate max_bitrate bitrate_ctrl_mode "
        "bitrate_storage video_channel video_on_usb video_file_index",
        "leds": "leds_anim",
        "detect": "enemy_colors groundstripe_colors enemy_without_shell detect_type "
        "detections_select_h detections_select_v_hsync detections_select_v",
        "syslog": "output max_size nb_files",
        "userbox": "userbox_cmd",
        "gps": "latitude longitude altitude",
        "custom": "application_id application_desc profile_id profile_desc session_id session_desc",
    }.items()
    for name in names.split()
]

# --- configuration ---------------------------------------------------------------------------


def test_a_setting_is_acknowledged_and_read_back():
    pilot = Pilot().connect(demo=False)
    found = configured(pilot, "control:control_vz_max", "1000")
    assert float(found["control:control_vz_max"]) == 1000.0
    pilot.wait(0.01)
    assert pilot.last.command_acknowledged
    pilot.send(Control(5))
    pilot.wait(0.01)
    assert not pilot.last.command_acknowledged


def test_a_setting_is_accepted_while_the_last_one_is_still_acknowledged():
    """Some clients send several settings and never reset the acknowledgement."""
    pilot = Pilot()
    pilot.send(Config("control:altitude_max", "2000"), Config("control:altitude_max", "2500"))
    pilot.send(Control(4))
    ((_, dump),) = pilot.drone.dumps()
    assert parse_configuration(dump)["control:altitude_max"] == "2500"


@pytest.mark.parametrize(
    ("key", "value", "kept"),
    [
        ("control:control_vz_max", "9000", 2000.0),
        ("control:control_vz_max", "1", 200.0),
        ("control:altitude_max", "-3", 500.0),
        ("control:euler_angle_max", "3.0", 0.52),
    ],
)
def test_settings_out_of_range_are_clipped(key, value, kept):
    assert float(configured(Pilot(), key, value)[key]) == kept


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("control:control_vz_max", "nan"),
        ("control:control_vz_max", "fast"),
        ("control:control_vz_max", "1e3" + "0" * 90),
        ("control:outdoor", "PERHAPS"),
        ("general:num_version_soft", "9"),
        ("custom:session_id", "xyz"),
        ("general:ardrone_name", "x" * 128),
        ("no:such_key", "1"),
    ],
)
def test_an_invalid_value_changes_nothing_though_its_key_is_acknowledged(key, value):
    pilot = Pilot().connect(demo=False)
    before = dict(pilot.drone.settings.values)
    assert configured(pilot, key, value) == before
    pilot.wait(0.01)
    assert pilot.last.command_acknowledged == (key in before)


def test_every_documented_key_is_acknowledged_and_can_be_read():
    """A client waits for each unknown key until its time-out and then fails."""
    pilot = Pilot().connect(demo=False)
    for key in DOCUMENTED:
        found = configured(pilot, key, pilot.drone.settings.values[key])
        assert key in found
        pilot.wait(0.01)
        assert pilot.last.command_acknowledged, key


def test_outdoor_flight_has_its_own_limits():
    pilot = Pilot()
    found = configured(pilot, "control:outdoor", "TRUE")
    assert float(found["control:control_vz_max"]) == 1000.0
    configured(pilot, "control:control_vz_max", "1500")
    found = configured(pilot, "control:outdoor", "FALSE")
    assert float(found["control:control_vz_max"]) == 700.0
    assert float(found["control:outdoor_control_vz_max"]) == 1500.0


def test_in_a_session_a_setting_needs_its_identifiers_right_before_it():
    pilot = Pilot()
    configured(pilot, "custom:session_id", "0000abcd")
    key = "control:altitude_max"
    assert configured(pilot, key, "2000")[key] == "3000"
    pilot.send(Control(5))
    pilot.send(ConfigIds("0000abcd", "00000000", "00000000"), Watchdog(), Config(key, "2000"))
    assert pilot.drone.settings.values[key] == "3000"
    pilot.send(ConfigIds("11111111", "00000000", "00000000"), Config(key, "2000"))
    assert pilot.drone.settings.values[key] == "3000"
    pilot.send(ConfigIds("0000abcd", "00000000", "00000000"), Config(key, "2000"))
    assert pilot.drone.settings.values[key] == "2000"
    configured(pilot, "custom:session_id", "-all")
    assert configured(pilot, key, "2500")[key] == "2500"


def test_the_height_limits_of_the_configuration_are_enforced():
    pilot = Pilot(delay=0.0)
    configured(pilot, "control:altitude_max", "1500")
    configured(pilot, "control:control_vz_max", "2000")
    pilot.fly()
    highest = 0.0
    for _ in range(300):
        pilot.wait(0.02, UP, Move(gaz=1.0))
        highest = max(highest, pilot.truth.height)
    assert pilot.truth.height == pytest.approx(1.5, abs=1e-3)
    assert highest < 1.55
    for _ in range(300):
        pilot.wait(0.02, UP, Move(gaz=-1.0))
    assert pilot.truth.height == pytest.approx(0.05, abs=0.02)
    assert pilot.truth.phase is Phase.FLYING


# --- hostile input ---------------------------------------------------------------------------

TOKENS = st.sampled_from(
    [
        b"AT*REF=", b"AT*PCMD=", b"AT*CONFIG=", b"AT*CTRL=", b"AT*CONFIG_IDS=", b"AT*COMWDG=",
        b"\r", b"\n", b",", b'"', b"1", b"2", b"512", b"256", b"2143289344", b"-1", b"1056964608",
        b"99999999999999999999", b'"control:altitude_max"', b'"general:navdata_demo","FALSE"',
        b"4,0", b"5,0", b"\x00", b"\xff",
    ]
)  # fmt: skip
DATAGRAMS = st.one_of(st.binary(max_size=200), st.lists(TOKENS, max_size=40).map(b"".join))


@settings(max_examples=60)
@given(st.lists(st.tuples(st.booleans(), DATAGRAMS, st.floats(0.0, 0.3)), max_size=30))
def test_arbitrary_datagrams_neither_break_the_drone_nor_make_it_send(datagrams):
    drone, now, received, sent = Drone(EmulatorOptions()), 0.0, 0, []
    configured_at = None
    for commands, datagram, later in datagrams:
        now += later
        if commands:
            drone.commanded(datagram, COMMANDS, now)
        else:
            drone.woken(datagram, NAVDATA, now)
        received += 1
        sent += drone.packets(now)
        if configured_at is None and any(len(packet) > 24 for packet, _ in sent):
            configured_at = now
        truth = drone.truth(now)
        assert math.isfinite(truth.height)
        assert abs(truth.setpoint) <= 2.0
    if configured_at is None:  # No datagram completed the handshake.
        assert len(sent) <= received
    drone.advance(now + 30.0)
    sent += drone.packets(now + 30.0)
    # The last datagram keeps the link for two seconds only.
    assert all(address == NAVDATA for _, address in sent)
    drone.advance(now + 60.0)
    assert drone.packets(now + 60.0) == []
    assert drone.truth(now + 60.0).phase is Phase.LANDED


def test_many_motion_commands_do_not_accumulate():
    pilot = Pilot(delay=100.0).fly()
    for _ in range(3000):
        pilot.send(Move(gaz=0.1))
    assert len(pilot.drone._in_transit) <= 1024


def test_listening_beyond_this_machine_requires_named_clients():
    with pytest.raises(ValueError, match="IP addresses that the emulator answers"):
        EmulatorOptions(host="0.0.0.0")
    with pytest.raises(ValueError, match="'anybody', which is not an IP address"):
        EmulatorOptions(host="0.0.0.0", clients=("anybody",))
    assert EmulatorOptions(host="0.0.0.0", clients=("192.168.1.2",)).answers("192.168.1.2")
    assert EmulatorOptions(host="::", clients=("fd00:0::2",)).answers("fd00::2")
    assert EmulatorOptions(host="::", clients=("192.168.1.2",)).answers("::ffff:192.168.1.2")


def test_a_host_name_that_resembles_the_loopback_is_not_accepted_as_one():
    for host in ("127.0.0.1.example.org", "127.evil"):
        with pytest.raises(ValueError, match="other computers can reach"):
            EmulatorOptions(host=host)
    for host in ("localhost", "127.0.0.2", "::1"):
        assert EmulatorOptions(host=host).only_here


@pytest.mark.parametrize("plant", ["kit", "thrust"])
def test_navdata_can_hold_the_largest_noise(plant):
    pilot = Pilot(plant=plant, noise=10.0, downlink=20.0).connect(demo=False).fly()
    pilot.wait(20.0, UP)
    heights = [parse_navdata(packet).height for packet in pilot.sent]
    assert len(heights) > 2000
    assert np.std(heights[1:]) == pytest.approx(10.0, rel=0.1)


def test_hosts_that_are_not_named_are_ignored_and_not_answered():
    heard = []

    class Receiver(asyncio.DatagramProtocol):
        def datagram_received(self, data, address):
            heard.append(data)

    async def call(host):
        loop = asyncio.get_running_loop()
        async with Emulator(EmulatorOptions(clients=("127.0.0.1",))) as emulator:
            for port, datagram in (
                (5554, WAKE),
                (5556, encode([Config("general:navdata_demo", "TRUE"), UP], 1)),
            ):
                ear, _ = await loop.create_datagram_endpoint(
                    Receiver, local_addr=(host, 0), remote_addr=("127.0.0.1", port)
                )
                ear.sendto(datagram)
            await asyncio.sleep(0.5)
            return emulator.truth()

    assert links.run(call("127.0.0.2")).phase is Phase.LANDED
    assert not heard
    assert links.run(call("127.0.0.1")).phase is Phase.TAKING_OFF
    assert heard
