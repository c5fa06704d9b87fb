"""Multicopters with ArduPilot or PX4, over MAVLink 2."""

from deadtime.links.mavlink.addresses import LinkAddress
from deadtime.links.mavlink.client import MAVLinkVehicle
from deadtime.links.mavlink.keys import read_key
from deadtime.links.mavlink.listening import heard_rows
from deadtime.links.mavlink.time_sync import LinkTime

__all__ = ["LinkAddress", "LinkTime", "MAVLinkVehicle", "heard_rows", "read_key"]
