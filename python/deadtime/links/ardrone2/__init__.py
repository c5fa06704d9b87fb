"""The AR.Drone 2.0: its commands, its navdata, its configuration, and a link to fly it."""

from deadtime.links.ardrone2.client import ARDrone2
from deadtime.links.ardrone2.configuration import parse_configuration, write_configuration
from deadtime.links.ardrone2.navdata import Navdata, build_navdata, parse_navdata
from deadtime.links.ardrone2.reader import LinkStatistics

__all__ = [
    "ARDrone2",
    "LinkStatistics",
    "Navdata",
    "build_navdata",
    "parse_configuration",
    "parse_navdata",
    "write_configuration",
]
