"""Navdata packets recorded from real drones, read from a folder beside the project."""

import struct

from flights import flight_path

#: A captured packet of a drone that waits to be configured.
BOOTSTRAP = bytes.fromhex("88776655100c804f0100000000000000ffff0800a6020000")


def full_packets():
    """500 packets of full navdata, one of them broken, as they were recorded."""
    log = flight_path("ardrone2_full_navdata_expD_every12.lp32").read_bytes()
    packets, at = [], 0
    while at < len(log):
        (length,) = struct.unpack_from("<I", log, at)
        packets.append(log[at + 4 : at + 4 + length])
        at += 4 + length
    return packets


def older_packet():
    """A full packet of an older firmware, whose options are fewer and shorter."""
    return flight_path("ardrone2_navdata_fw_older_2120B.bin").read_bytes()


def demo_packet():
    """Return a short packet, built from a real full one."""
    return flight_path("ardrone2_demo_from_real_172B.bin").read_bytes()
