"""The AR.Drone 2.0: its commands, its navdata and its configuration."""

from deadtime.links.ardrone2.configuration import parse_configuration, write_configuration
from deadtime.links.ardrone2.navdata import Navdata, build_navdata, parse_navdata

__all__ = [
    "Navdata",
    "build_navdata",
    "parse_configuration",
    "parse_navdata",
    "write_configuration",
]
