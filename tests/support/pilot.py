"""A client of the emulated AR.Drone 2.0 without sockets, for tests."""

from deadtime.links.ardrone2.commands import (
    Config,
    Control,
    Ref,
    encode,
)
from deadtime.links.ardrone2.configuration import parse_configuration
from deadtime.links.ardrone2.emulator import (
    Drone,
    EmulatorOptions,
    Phase,
)
from deadtime.links.ardrone2.navdata import parse_navdata

NAVDATA, COMMANDS = ("127.0.0.1", 40001), ("127.0.0.1", 40002)
UP, DOWN = Ref(take_off=True), Ref()
WAKE = b"\x01\x00\x00\x00"


class Pilot:
    """A client without sockets: sends commands at given times and reads the navdata."""

    def __init__(self, **options):
        options.setdefault("noise", 0.0)
        self.drone = Drone(EmulatorOptions(**options))
        self.time, self.number, self.sent = 0.0, 1, []

    def send(self, *commands):
        self.drone.commanded(encode(commands, self.number), COMMANDS, self.time)
        self.number += len(commands)
        self.take()

    def wake(self, datagram=WAKE, source=NAVDATA):
        self.drone.woken(datagram, source, self.time)
        return [packet for packet, _ in self.take()]

    def take(self):
        new = self.drone.packets(self.time)
        self.sent += [packet for packet, _ in new]
        return new

    def wait(self, duration, *commands, every=0.02):
        """Advance the time, sending the same commands every `every` seconds, or nothing."""
        until = round(self.time + duration, 6)
        while commands and round(self.time + every, 6) <= until:
            self.time = round(self.time + every, 6)
            self.send(*commands)
        self.time = until
        self.drone.advance(until)
        self.take()
        return self.truth

    @property
    def truth(self):
        return self.drone.truth(self.time)

    @property
    def last(self):
        return parse_navdata(self.sent[-1])

    def connect(self, demo=True):
        self.wake()
        self.send(Config("general:navdata_demo", "TRUE" if demo else "FALSE"))
        self.send(Control(5))
        return self

    def fly(self):
        """Take off and hover until the drone is at rest."""
        self.wait(12.0, UP)
        assert self.truth.phase is Phase.FLYING
        return self


def configured(pilot, key, value):
    """Set a key and return the configuration that the drone then reports."""
    pilot.send(Control(5))
    pilot.send(Config(key, value))
    pilot.send(Control(4))
    ((host, dump),) = pilot.drone.dumps()
    assert host == COMMANDS[0]
    return parse_configuration(dump)
