"""A vehicle that consists of a height model only, for tests in virtual time."""

import asyncio

from deadtime.links import Motion, VehicleState

#: The height model of the development kit: b1, b0, a of (b1 s + b0) / (s (s + a)).
KIT = (0.15265, 5.1529, 5.820)


class SimulatedVehicle:
    """The height model of the development kit with a delay.

    `change_state` may change any state that the vehicle reports.
    """

    axes = ("z",)

    def __init__(self, delay=0.26, noise=0.0, random=None, change_state=None, reports_climb=True):
        self.delay, self.noise, self.random = delay, noise, random
        self.change_state = change_state or (lambda state, since: state)
        self.reports_climb = reports_climb
        self.commands, self.log = [], []
        self.height, self.speed, self.flying = 0.0, 0.0, False
        self.sequence, self.listener, self.task = 0, None, None
        self.newest = None

    async def connect(self):
        self.clock = asyncio.get_running_loop().time
        self.commands, self.sequence, self.newest = [], 0, None
        self.task = asyncio.create_task(self._fly())
        self.log.append("connected")

    async def take_off(self):
        await asyncio.sleep(0.5)
        self.height, self.speed, self.flying, self.began = 0.75, 0.0, True, self.clock()
        self.log.append("took off")
        await asyncio.sleep(0.1)

    async def state(self):
        while self.newest is None:
            await asyncio.sleep(0.005)
        return self.newest

    def listen(self, listener):
        self.listener = listener

    def command(self, climb):
        climb = max(-1.0, min(1.0, climb))
        self.commands.append((self.clock(), climb))
        return climb

    def command_velocity(self, north=0.0, east=0.0, up=0.0, turn=None):
        assert (north, east, turn or 0.0) == (0.0, 0.0, 0.0)
        return Motion(up=self.command(up))

    def hover(self):
        self.log.append("hovers")
        self.commands.append((self.clock(), 0.0))

    async def land(self):
        if self.flying:
            self.log.append("landed")
        self.flying, self.height = False, 0.0

    async def close(self):
        await self.land()
        self.task.cancel()
        self.log.append("closed")

    async def __aenter__(self):
        await self.connect()
        return self

    async def __aexit__(self, *reason):
        await self.close()

    def _setpoint(self, now):
        late = [value for time, value in self.commands if time <= now - self.delay + 1e-9]
        self.commands = self.commands[max(0, len(late) - 1) :]
        return late[-1] if late else 0.0

    async def _fly(self):
        """Steps of 5 ms, exact for a setpoint that changes between steps only."""
        b1, b0, a = KIT
        step, slow, began = 0.005, 0.0, self.clock()
        while True:
            self.sequence += 1
            await asyncio.sleep(max(0.0, began + self.sequence * step - self.clock()))
            setpoint = self._setpoint(self.clock()) if self.flying else 0.0
            slow += step * (-a * slow + (b0 - a * b1) * setpoint)
            self.speed = slow + b1 * setpoint
            if self.flying:
                self.height += step * self.speed
            error = self.random.normal(0.0, self.noise) if self.noise else 0.0
            state = VehicleState(
                time=self.clock(),
                height=self.height + error,
                flying=self.flying,
                landed=not self.flying,
                sequence=self.sequence,
                vehicle_time=self.sequence * step,
                climb=self.speed if self.reports_climb else None,
                climb_setpoint=setpoint if self.reports_climb else None,
                battery=80.0,
            )
            since = self.clock() - self.began if self.flying else -1.0
            state = self.change_state(state, since)
            if state is not None:
                self.newest = state
                if self.listener is not None:
                    self.listener(state)
