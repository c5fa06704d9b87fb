"""A control loop over UDP: its packets."""

from deadtime.links.udp.packets import LoopPacket, decode_doubles, encode_doubles

__all__ = ["LoopPacket", "decode_doubles", "encode_doubles"]
