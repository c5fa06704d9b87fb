"""The configuration keys of an AR.Drone 2.0: kinds, ranges and initial values.

The keys are those of the developer guide and of the SDK's header ``config_keys.h``, which also
states which of them are read-only, and further ones of firmware 2.4. Values of sensors and hardware
are invented.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

#: DEMO and VISION_DETECT.
NAVDATA_OPTIONS = 65537

#: Largest length of a value: the SDK's strings have 128 bytes, the last one zero.
LONGEST = 127

NO_ID = "00000000"

Kind = Literal["whole", "number", "truth", "text", "id", "fixed"]

#: Range of the drone's integers.
LEAST, MOST = -(2**31), 2**31 - 1


@dataclass(frozen=True)
class Entry:
    """One key: its initial value, its kind, and its range if it is a number."""

    value: str
    kind: Kind = "fixed"
    low: float = -math.inf
    high: float = math.inf


def _whole(value: int, low: int = LEAST, high: int = MOST) -> Entry:
    return Entry(str(value), "whole", low, high)


def _number(value: float, low: float, high: float) -> Entry:
    return Entry(f"{value:.7e}", "number", low, high)


def _vector(*values: float) -> Entry:
    """Numbers of a calibration, in the format of the drone; they are read-only."""
    return Entry(f"{{ {' '.join(f'{value:.7e}' for value in values)} }}")


MOTORS = {
    f"general:motor{motor}_{what}": Entry(version)
    for motor in (1, 2, 3, 4)
    for what, version in (("soft", "1.43"), ("hard", "6.0"), ("supplier", "1.1"))
}

#: All keys. The ranges are those of the developer guide; those it does not give are wide.
ENTRIES: dict[str, Entry] = {
    "general:num_version_config": Entry("1"),
    "general:num_version_mb": Entry("34"),
    "general:num_version_soft": Entry("2.4.8"),
    "general:drone_serial": Entry("EMULATED"),
    "general:soft_build_date": Entry("1970-01-01 00:00"),
    **MOTORS,
    "general:ardrone_name": Entry("deadtime emulator", "text"),
    "general:flying_time": Entry("0"),
    "general:navdata_demo": Entry("TRUE", "truth"),
    "general:navdata_options": _whole(NAVDATA_OPTIONS, 0),
    "general:com_watchdog": Entry("2"),
    "general:video_enable": Entry("TRUE", "truth"),
    "general:vision_enable": Entry("TRUE", "truth"),
    "general:vbat_min": Entry("9000"),
    "general:localtime": _whole(0, 0),
    "general:localtime_zone": Entry("UTC", "text"),
    "general:timezone": Entry("UTC", "text"),
    "general:battery_type": _whole(0),
    "general:gps_soft": Entry("0"),
    "general:gps_hard": Entry("0"),
    "control:accs_offset": _vector(-2048.0, 2048.0, 2048.0),
    "control:accs_gains": _vector(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0),
    "control:gyros_offset": _vector(0.0, 0.0, 0.0),
    "control:gyros_gains": _vector(1.0, -1.0, -1.0),
    "control:gyros110_offset": _vector(0.0, 0.0),
    "control:gyros110_gains": _vector(1.0, -1.0),
    "control:magneto_offset": _vector(0.0, 0.0, 0.0),
    "control:magneto_radius": Entry("1.0000000e+02"),
    "control:gyro_offset_thr_x": Entry("4.0000000e+00"),
    "control:gyro_offset_thr_y": Entry("4.0000000e+00"),
    "control:gyro_offset_thr_z": Entry("5.0000000e-01"),
    "control:pwm_ref_gyros": Entry("500"),
    "control:osctun_value": Entry("0"),
    "control:osctun_test": Entry("FALSE"),
    "control:control_level": _whole(0, 0, 3),
    "control:euler_angle_max": _number(0.20943952, 0.0, 0.52),
    "control:altitude_max": _whole(3000, 500, 100_000),
    "control:altitude_min": _whole(50, 50, 1000),
    "control:control_iphone_tilt": _number(0.34906584, 0.0, 0.87),
    "control:control_vz_max": _number(700.0, 200.0, 2000.0),
    "control:control_yaw": _number(1.7453293, 0.7, 6.11),
    "control:outdoor": Entry("FALSE", "truth"),
    "control:flight_without_shell": Entry("FALSE", "truth"),
    "control:autonomous_flight": Entry("FALSE", "truth"),
    "control:manual_trim": Entry("FALSE", "truth"),
    "control:indoor_euler_angle_max": _number(0.20943952, 0.0, 0.52),
    "control:indoor_control_vz_max": _number(700.0, 200.0, 2000.0),
    "control:indoor_control_yaw": _number(1.7453293, 0.7, 6.11),
    "control:outdoor_euler_angle_max": _number(0.34906584, 0.0, 0.52),
    "control:outdoor_control_vz_max": _number(1000.0, 200.0, 2000.0),
    "control:outdoor_control_yaw": _number(3.4906585, 0.7, 6.11),
    "control:flying_mode": _whole(0, 0, 3),
    "control:hovering_range": _whole(1000, 0),
    "control:flight_anim": Entry("0,0", "text"),
    "control:flying_camera_enable": Entry("FALSE", "truth"),
    "control:flying_camera_mode": Entry("0,0,0,0,0,0,0,0,0,0", "text"),
    "network:ssid_single_player": Entry("ardrone2_emulated", "text"),
    "network:ssid_multi_player": Entry("ardrone2_emulated", "text"),
    "network:wifi_mode": _whole(0, 0, 2),
    "network:wifi_rate": _whole(0),
    "network:owner_mac": Entry("00:00:00:00:00:00", "text"),
    "pic:ultrasound_freq": _whole(8),
    "pic:ultrasound_watchdog": _whole(3),
    "pic:pic_version": Entry("262192"),
    "video:camif_fps": Entry("30"),
    "video:codec_fps": _whole(30, 15, 30),
    "video:camif_buffers": Entry("2"),
    "video:num_trackers": Entry("12"),
    "video:video_codec": _whole(129, 0, 255),
    "video:video_slices": _whole(0),
    "video:video_live_socket": _whole(0),
    "video:video_storage_space": Entry("0"),
    "video:bitrate": _whole(1000, 0),
    "video:max_bitrate": _whole(1000, 0),
    "video:bitrate_ctrl_mode": _whole(0, 0, 2),
    "video:bitrate_storage": _whole(4000, 0),
    "video:video_channel": _whole(0, 0, 3),
    "video:video_on_usb": Entry("TRUE", "truth"),
    "video:video_file_index": _whole(1, 0),
    "video:exposure_mode": Entry("0", "text"),
    "video:saturation_mode": Entry("0", "text"),
    "video:whitebalance_mode": Entry("0", "text"),
    "leds:leds_anim": Entry("0,0,0", "text"),
    "detect:enemy_colors": _whole(1),
    "detect:groundstripe_colors": _whole(16),
    "detect:enemy_without_shell": _whole(0),
    "detect:detect_type": _whole(3, 0, 13),
    "detect:detections_select_h": _whole(0),
    "detect:detections_select_v_hsync": _whole(0),
    "detect:detections_select_v": _whole(0),
    "syslog:output": _whole(7),
    "syslog:max_size": _whole(102_400),
    "syslog:nb_files": _whole(5),
    "userbox:userbox_cmd": Entry("0", "text"),
    # Doubles, sent as the decimal integer of their 64 bits: stored as received.
    "gps:latitude": Entry("5.0000000000000000e+02", "text"),
    "gps:longitude": Entry("5.0000000000000000e+02", "text"),
    "gps:altitude": Entry("0.0000000000000000e+00", "text"),
    "custom:application_id": Entry(NO_ID, "id"),
    "custom:application_desc": Entry("Default application configuration", "text"),
    "custom:profile_id": Entry(NO_ID, "id"),
    "custom:profile_desc": Entry("Default profile configuration", "text"),
    "custom:session_id": Entry(NO_ID, "id"),
    "custom:session_desc": Entry("Default session configuration", "text"),
}
