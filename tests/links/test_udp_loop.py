"""Plant and controller over UDP in virtual time: exact with constant delays, safe with faults.

One subject, kept in one file: every test runs the same trial with other options.
"""

import asyncio
import math
from functools import partial

import numpy as np
import pytest
from deadtime import ControlLoop, Integrator, P
from deadtime.links import virtual_time
from deadtime.links.udp import (
    Bursts,
    Controller,
    ControllerOptions,
    DropLate,
    HeldIntegrator,
    HoldThenZero,
    JitterBuffer,
    LoopPacket,
    Network,
    NewestWins,
    Normal,
    Plant,
    PlantOptions,
    Relay,
    RelayOptions,
    ShiftedGamma,
    Trial,
    run_plant,
    run_trial,
)
from hypothesis import given, settings, strategies as st

WAY = Network(delay=0.05)
WATCHDOG, LIMIT = 0.5, 5.0

#: The worst options of a relay, one fault at a time and all together.
FAULTS = {
    "60 % loss": Network(delay=0.05, loss=0.6),
    "bursts": Network(delay=0.05, loss=Bursts.of(0.3, 20.0)),
    "blackout of 2 s": Network(delay=0.05, blackouts=((1.5, 3.5),)),
    "duplicates": Network(delay=Normal(0.05, 0.02), duplication=0.8),
    "reversed order": Network(delay=0.05, reversed_groups=7),
    "10 x jitter": Network(delay=Normal(0.05, 0.1)),
    "slow": Network(delay=0.05, rate=3000.0, queue=0.4),
    "all": Network(
        delay=ShiftedGamma(0.02, 0.1, 0.1),
        loss=0.3,
        duplication=0.3,
        blackouts=((1.5, 3.5),),
        reversed_groups=3,
    ),
}

POLICIES = (NewestWins(), DropLate(0.2), HoldThenZero(5), JitterBuffer(0.15))


async def watched(work):
    """Return the result of a coroutine and raise errors that occur in callbacks."""
    wrong = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: wrong.append(context))
    result = await work
    for _ in range(10):  # Errors whose callbacks are still pending.
        await asyncio.sleep(0)
    assert not wrong, wrong
    return result


def in_virtual_time(work):
    return virtual_time.run(watched(work))


def run(trial, **more):
    return in_virtual_time(run_trial(trial, **more))


def loop_of(trial, delay):
    return ControlLoop(
        Integrator(gain=trial.plant_gain, lag=trial.lag),
        P(Kp=trial.gain),
        delay=delay,
        sample_time=trial.sample_time,
        limit=trial.limit,
    )


@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_with_constant_delays_it_is_the_sampled_loop(lag):
    trial = Trial(gain=8.0, forward_path=WAY, return_path=WAY, lag=lag, limit=5.0)
    recording = run(trial).plant.recording
    model = loop_of(trial, 0.1).simulate(
        recording.time, recording.reference, reference_time=recording.time
    )
    assert np.abs(model.outputs - recording.output).max() < 1e-9


def test_measured_delays_are_exact():
    report = run(Trial(gain=8.0, forward_path=Network(0.03), return_path=Network(0.07)))
    link = report.plant.link
    assert link.round_trip.p50 == pytest.approx(0.1, abs=1e-9)
    assert link.round_trip.largest == pytest.approx(0.1, abs=1e-9)
    assert report.plant.age == pytest.approx(0.105, abs=1e-9)
    assert report.plant.oldest == pytest.approx(0.11, abs=1e-9)
    assert report.plant.period.largest == pytest.approx(0.01, abs=1e-9)
    assert (link.lost, link.late, link.reordered, report.plant.trips) == (0, 0, 0, 0)
    # The division of the round trip cannot be measured, but the bounds hold.
    assert link.forward_delay[0] <= 0.03 <= link.forward_delay[1]
    assert link.return_delay[0] <= 0.07 <= link.return_delay[1]
    assert abs(link.offset) <= link.offset_uncertainty


def test_a_run_is_determined_by_its_seed_to_the_byte(tmp_path):
    network = Network(delay=Normal(0.05, 0.01), loss=0.05, duplication=0.1)

    def written(seed, folder):
        report = run(
            Trial(gain=8.0, forward_path=network, return_path=network, seed=seed),
            folder=tmp_path / folder,
        )
        files = sorted((tmp_path / folder).iterdir())
        return [file.read_bytes() for file in files], repr(report.to_dict())

    assert written(7, "a") == written(7, "b")
    assert written(8, "c") != written(7, "d")


def test_a_recording_that_cannot_be_written_ends_the_run(tmp_path):
    options = PlantOptions(
        controller=("127.0.0.1", 9), recording=tmp_path / "plant.csv", duration=5.0
    )

    class FullError(Exception):
        pass

    async def disk_fills_up(monkeypatch):
        loop = asyncio.get_running_loop()

        def write(self, row):
            if loop.time() > 1.0:
                raise FullError

        monkeypatch.setattr("deadtime.links.journal.Journal.write", write)
        with pytest.raises(FullError):
            await run_plant(options)
        return loop.time()

    with pytest.MonkeyPatch.context() as monkeypatch:
        assert in_virtual_time(disk_fills_up(monkeypatch)) == pytest.approx(1.01, abs=0.01)


def test_an_end_that_cannot_record_releases_its_port(tmp_path):
    existing = tmp_path / "existing.csv"
    existing.touch()
    address = ("127.0.0.1", 40_000)

    async def twice(end, **more):
        with pytest.raises(FileExistsError):
            async with end(**more, listen=address, recording=existing):
                pass
        async with end(**more, listen=address) as second:
            return second.address

    for end, options, more in (
        (Controller, ControllerOptions, {"gain": 1.0}),
        (Plant, PlantOptions, {"controller": ("127.0.0.1", 9)}),
    ):
        made = partial(lambda end, options, **given: end(options(**given)), end, options)
        assert in_virtual_time(twice(made, **more)) == address


def test_losses_are_counted_exactly():
    relays = []
    network = Network(delay=0.05, loss=0.1, duplication=0.1)
    trial = Trial(gain=6.0, forward_path=network, return_path=network, seed=5)
    report = run(trial, meanwhile=lambda relay, controller: relays.append(relay))
    (relay,) = relays
    # Packets in transit at the end, or lost after the last that arrived, are not counted.
    assert report.controller.link.lost == pytest.approx(relay.forward_path.lost, abs=3)
    assert report.plant.link.lost == pytest.approx(relay.return_path.lost, abs=3)
    assert report.controller.link.duplicates == pytest.approx(relay.forward_path.duplicated, abs=3)
    assert report.plant.link.reordered == 0
    assert report.plant.link.loss == pytest.approx(0.1, abs=0.04)


def test_a_jitter_buffer_makes_a_random_delay_constant():
    network = Network(delay=Normal(0.05, 0.01))
    wild = Trial(gain=6.0, forward_path=network, return_path=network, seed=2)
    tame = Trial(
        gain=6.0, forward_path=network, return_path=network, seed=2, policy=JitterBuffer(0.16)
    )
    assert run(wild).plant.age_when_applied.p95 > run(wild).plant.age_when_applied.p50 + 0.01
    report = run(tame)
    ages = report.plant.age_when_applied
    assert ages.largest == pytest.approx(0.16, abs=1e-9)
    assert ages.mean == pytest.approx(0.16, abs=1e-9)
    recording = report.plant.recording
    model = loop_of(tame, 0.16).simulate(
        recording.time, recording.reference, reference_time=recording.time
    )
    assert np.abs(model.outputs - recording.output).max() < 1e-9


def test_answers_may_take_as_long_as_the_watchdog_allows():
    network = Network(delay=2.4)
    trial = Trial(
        gain=0.1,
        forward_path=network,
        return_path=network,
        sample_time=1e-3,
        watchdog=5.0,
        duration=6.0,
    )
    report = run(trial)
    assert report.plant.link.invalid == 0
    assert report.plant.applied > 1000
    assert report.plant.age_when_applied.largest == pytest.approx(4.8, abs=1e-9)


def test_late_commands_are_dropped_if_requested():
    network = Network(delay=ShiftedGamma(0.03, 0.05, 0.02))
    report = run(Trial(gain=6.0, forward_path=network, return_path=network, policy=DropLate(0.1)))
    assert report.plant.age_when_applied.largest <= 0.1
    assert report.plant.link.late > 20
    assert report.plant.link.lateness.largest > 0.0
    edges, counts = report.plant.link.lateness_histogram
    assert sum(counts) == report.plant.link.late
    assert edges[-1] == report.plant.link.lateness.largest


def test_a_command_without_successor_is_released():
    return_path = Network(delay=0.05, blackouts=((1.2, 3.0),))
    trial = Trial(gain=2.0, forward_path=WAY, return_path=return_path, policy=HoldThenZero(5))
    recording = run(trial).plant.recording
    # What was sent before the blackout arrives until 1.25 s, and holds for five samples of 10 ms.
    held = (recording.time > 1.20) & (recording.time < 1.29)
    gone = (recording.time > 1.31) & (recording.time < 3.0)
    assert (recording.command[held] > 0.0).all()
    assert (recording.command[gone] == 0.0).all()


def test_the_watchdog_applies_the_safe_command_in_time_and_releases_it_again():
    return_path = Network(delay=0.05, blackouts=((1.2, 3.0),))
    trial = Trial(gain=2.0, forward_path=WAY, return_path=return_path, watchdog=0.3, safe=-0.1)
    report = run(trial)
    recording = report.plant.recording
    safe = recording.time[recording.command == -0.1]
    safe = safe[safe > 1.0]  # The safe command also holds until the first command arrives.
    assert safe[0] == pytest.approx(1.25 + 0.3, abs=0.011)
    assert safe[-1] == pytest.approx(3.05, abs=0.011)
    assert report.plant.trips == 1
    assert report.plant.safe_time == pytest.approx(3.05 - 1.55, abs=0.02)


def test_a_controller_without_measurements_commands_the_plant_to_be_safe():
    forward_path = Network(delay=0.05, blackouts=((1.2, 9.0),))
    trial = Trial(gain=2.0, forward_path=forward_path, return_path=WAY, watchdog=0.4, safe=0.25)
    report = run(trial)
    recording = report.plant.recording
    safe = recording.time[(recording.command == 0.25) & (recording.time > 1.0)]
    # Silence from 1.25 s on, detected 0.4 s later, received by the plant 0.05 s after that.
    assert safe[0] == pytest.approx(1.25 + 0.4 + 0.05, abs=0.011)
    assert safe[-1] == recording.time[-1]
    assert report.controller.trips == 1
    assert report.plant.trips == 1


def test_a_controller_announces_its_end_and_a_new_one_takes_over():
    async def change_of_controllers():
        async with Controller(ControllerOptions(gain=2.0)) as first:
            port = first.address[1]
            async with Relay(RelayOptions(first.address, WAY, WAY)) as relay:
                plant = asyncio.ensure_future(run_plant(PlantOptions(controller=relay.address)))
                await asyncio.sleep(1.2)
                await first.__aexit__(None, None, None)
                await asyncio.sleep(0.8)
                second = ControllerOptions(gain=2.0, listen=("127.0.0.1", port))
                async with Controller(second):
                    return await plant

    report = in_virtual_time(change_of_controllers())
    recording = report.recording
    still = (recording.time > 1.26) & (recording.time < 2.05)
    assert (recording.command[still] == 0.0).all()
    assert abs(recording.output[-1] - 1.0) < 0.02
    assert report.trips == 1


@pytest.mark.parametrize("policy", POLICIES, ids=lambda one: type(one).__name__)
@pytest.mark.parametrize("fault", FAULTS)
def test_no_fault_of_the_relay_makes_the_plant_unsafe(fault, policy):
    for seed in range(3):
        network = FAULTS[fault]
        trial = Trial(
            gain=8.0,
            forward_path=network,
            return_path=network,
            seed=seed,
            limit=LIMIT,
            watchdog=WATCHDOG,
            policy=policy,
        )
        check_safety(trial, run(trial))


@settings(max_examples=40)
@given(
    delay=st.floats(0.0, 0.3),
    deviation=st.floats(0.001, 0.5),
    loss=st.floats(0.0, 0.95),
    burst=st.floats(20.0, 60.0),
    duplication=st.floats(0.0, 1.0),
    blackout=st.tuples(st.floats(0.0, 4.0), st.floats(0.01, 4.0)),
    groups=st.integers(1, 12),
    ordered=st.booleans(),
    gain=st.floats(0.1, 50.0),
    policy=st.sampled_from(POLICIES),
    seed=st.integers(0, 2**31),
)
def test_no_schedule_of_faults_makes_the_plant_unsafe(
    delay, deviation, loss, burst, duplication, blackout, groups, ordered, gain, policy, seed
):
    network = Network(
        delay=Normal(delay, deviation),
        loss=Bursts.of(loss, burst),
        duplication=duplication,
        ordered=ordered,
        blackouts=((blackout[0], blackout[0] + blackout[1]),),
        reversed_groups=groups,
    )
    trial = Trial(
        gain=gain,
        forward_path=network,
        return_path=network,
        seed=seed,
        limit=LIMIT,
        watchdog=WATCHDOG,
        policy=policy,
        duration=4.0,
    )
    check_safety(trial, run(trial))


def check_safety(trial, report):
    recording = report.plant.recording
    assert np.abs(recording.command).max() <= LIMIT
    assert report.plant.largest_command <= LIMIT
    assert report.controller.largest_command <= LIMIT
    # A command is at most as old as the watchdog's time when it is applied, and holds no longer
    # than that: after twice that time without packets the plant is safe, whatever happened before.
    assert report.plant.oldest <= 2.0 * WATCHDOG + 1e-9
    assert report.plant.age_when_applied.count == 0 or (
        report.plant.age_when_applied.largest <= WATCHDOG + 1e-9
    )
    # A plant without new commands has a bounded speed, so the change of its output is bounded.
    assert np.abs(np.diff(recording.output)).max() <= LIMIT * trial.sample_time + 1e-9
    for start, stop in trial.return_path.blackouts:
        silent = (recording.time > start + 2.0 * WATCHDOG) & (recording.time < stop)
        assert (recording.command[silent] == trial.safe).all()


def test_any_seed_of_a_bad_network_leaves_the_output_bounded():
    network = Network(delay=Normal(0.05, 0.01), loss=Bursts.of(0.05, 4.0))
    for seed in range(8):
        report = run(Trial(gain=6.0, forward_path=network, return_path=network, seed=seed))
        assert report.plant.largest_output < 2.0
        assert abs(report.plant.recording.output[-1] - 1.0) < 0.5


class Attacker(asyncio.DatagramProtocol):
    """Sends any packets to any address and has read the last measurement."""

    heard = LoopPacket(0, 0.0)

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, addr):
        self.heard = LoopPacket.decode(data)


async def attacked(packets, *, from_the_peer=True):
    """Report of the plant when `packets`, made from a measurement, arrive while it runs."""
    loop = asyncio.get_running_loop()
    _, attacker = await loop.create_datagram_endpoint(Attacker, local_addr=("127.0.0.1", 41_000))
    peer = ("127.0.0.1", 41_000 if from_the_peer else 42_000)
    options = PlantOptions(controller=peer, listen=("127.0.0.1", 40_000), duration=1.0)
    plant = asyncio.ensure_future(run_plant(options))
    await asyncio.sleep(0.505)
    for packet in packets(attacker.heard):
        attacker.transport.sendto(packet, options.listen)
    report = await plant
    attacker.transport.close()
    return report


def answer(measurement, **change):
    """A command that is valid for the plant except for the changed fields."""
    words = {
        "sequence": 1,
        "sent": measurement.sent,
        "echo_sequence": measurement.sequence,
        "echo_sent": measurement.sent,
        "value": 3.0,
    }
    return LoopPacket(**{**words, **change}).encode()


def test_an_answer_to_the_last_measurement_is_applied():
    report = in_virtual_time(attacked(lambda measured: [answer(measured)]))
    assert (report.applied, report.largest_command) == (1, 3.0)


def test_packets_from_other_addresses_are_not_applied():
    def forged(_):
        number, sent = 51, 0.5  # An attacker can guess the current measurement.
        return [LoopPacket(1, sent, echo_sequence=number, echo_sent=sent, value=3.0).encode()] * 5

    report = in_virtual_time(attacked(forged, from_the_peer=False))
    assert report.link.foreign == 5
    assert report.applied == 0


@pytest.mark.parametrize(
    "change",
    [
        {"echo_sequence": 0},  # It answers nothing.
        {"echo_sequence": 9999},  # The measurement was never sent.
        {"echo_sequence": 7},  # Not sent at that time.
        {"echo_sent": 0.9},  # Not sent yet.
        {"held": 0.2},  # The hold is longer than possible.
    ],
)
def test_impossible_answers_are_not_applied(change):
    report = in_virtual_time(attacked(lambda measured: [answer(measured, **change)]))
    assert report.applied == 0
    assert report.link.invalid == 1


@pytest.mark.parametrize("change", [{"echo_sequence": 9999}, {"echo_sent": 0.1}, {"held": 0.2}])
def test_a_sender_that_has_not_received_the_plant_cannot_make_it_safe(change):
    report = in_virtual_time(attacked(lambda measured: [answer(measured, flags=1, **change)]))
    assert (report.link.invalid, report.trips) == (1, 0)


def test_on_a_safe_request_the_plant_applies_its_own_safe_command():
    report = in_virtual_time(attacked(lambda measured: [answer(measured, flags=1, value=20.0)]))
    assert report.trips == 1
    assert (report.recording.command == 0.0).all()


@given(st.lists(st.binary(max_size=80), max_size=20))
@settings(max_examples=25)
def test_bytes_that_are_not_packets_are_counted_and_ignored(packets):
    report = in_virtual_time(attacked(lambda _: packets))
    assert report.link.invalid == len(packets)
    assert report.applied == 0


@given(
    value=st.floats(-1e100, 1e100),  # Larger numbers do not occur in a loop.
    flags=st.integers(0, 3),
    times=st.integers(1, 200),
)
@settings(max_examples=50)
def test_every_command_of_the_peer_is_clipped_to_the_limit(value, flags, times):
    def commands(measured):
        return [
            answer(measured, value=value, flags=flags, sequence=1 + number)
            for number in range(times)
        ]

    report = in_virtual_time(attacked(commands))
    assert np.abs(report.recording.command).max() <= 20.0
    assert report.applied <= 1
    assert report.trips + report.applied >= 1


def test_bare_doubles_close_the_loop_without_measured_delays():
    async def simulink():
        options = ControllerOptions(gain=4.0, doubles=(2, 1))
        async with (
            Controller(options) as controller,
            Relay(RelayOptions(controller.address, WAY, WAY)) as relay,
        ):
            plant = PlantOptions(controller=relay.address, doubles=(1, 2))
            return await run_plant(plant), controller.report()

    report, other = in_virtual_time(simulink())
    assert report.recording.output[-1] == pytest.approx(1.0, abs=1e-3)
    assert report.link.round_trip.count == 0
    assert math.isnan(report.age)
    assert report.trips == 0
    assert other.answered > 490


def test_a_watchdog_that_would_act_between_two_commands_is_refused():
    with pytest.raises(ValueError, match="would trip between"):
        Trial(gain=1.0, sample_time=0.5, watchdog=0.5)
    with pytest.raises(ValueError, match="older than"):
        Trial(gain=1.0, policy=JitterBuffer(0.6), watchdog=0.5)


def test_options_that_need_times_are_refused_for_bare_doubles():
    with pytest.raises(ValueError, match="time stamps"):
        PlantOptions(controller=("127.0.0.1", 1), doubles=(1, 1), policy=JitterBuffer(0.1))


@pytest.mark.parametrize("lag", [0.0, 0.3])
def test_the_integrator_gives_the_same_for_any_division_of_time(lag):
    whole, parts = HeldIntegrator(lag=lag), HeldIntegrator(lag=lag)
    whole.advance(1.0, 0.7)
    for _ in range(64):
        parts.advance(1.0 / 64.0, 0.7)
    assert parts.output == pytest.approx(whole.output, rel=1e-13)
    assert parts.velocity == pytest.approx(whole.velocity, rel=1e-13)


def test_other_hosts_work_and_cause_a_warning(capsys):
    async def two_computers():
        options = ControllerOptions(gain=4.0, listen=("192.0.2.1", 5600))
        async with Controller(options) as controller:
            plant = PlantOptions(controller=controller.address, listen=("192.0.2.2", 0))
            return await run_plant(plant)

    report = in_virtual_time(two_computers())
    assert report.recording.output[-1] == pytest.approx(1.0, abs=1e-3)
    errors = capsys.readouterr().err
    assert "192.0.2.1" in errors
    assert "every host that reaches" in errors


def test_this_host_causes_no_warning(capsys):
    run(Trial(gain=4.0, duration=1.0))
    assert capsys.readouterr().err == ""
