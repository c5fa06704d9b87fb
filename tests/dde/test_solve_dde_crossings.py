"""Every sign change of an event is found: closed forms, jumps, both ends, order of time."""

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, strategies as st


def rest(t, y, z):
    return 0.0 * z[0]


def oscillator(omega):
    """y = (sin, cos)(omega t + phase); the delay has no effect."""

    def fun(t, y, z):
        return [omega * y[1], -omega * y[0]]

    return fun


def solved(omega, phase, end, **options):
    return dtm.solve_dde(
        oscillator(omega),
        (0.0, end),
        [np.sin(phase), np.cos(phase)],
        1.0,
        vectorized=True,
        rtol=1e-10,
        atol=1e-12,
        **options,
    )


def zeros(omega, phase, end):
    first, last = np.ceil(phase / np.pi), np.floor((omega * end + phase) / np.pi)
    return (np.pi * np.arange(first, last + 1) - phase) / omega


def test_two_zeros_between_neighbouring_nodes_are_found():
    # Of the 38 zeros of sin(40 t) 16 were found.
    found = dtm.solve_dde(rest, (0, 3), 1.0, 1.0, events=lambda t, y: np.sin(40.0 * t))
    assert found.t_events[0] == pytest.approx(np.pi / 40.0 * np.arange(1, 39), abs=1e-14)


@given(st.floats(0.5, 60.0), st.floats(-3.1, 3.1), st.sampled_from([-1, 0, 1]))
def test_crossings_of_sines_are_all_found(omega, phase, direction):
    def event(t, y):
        return np.sin(omega * t + phase)

    event.direction = direction
    found = dtm.solve_dde(rest, (0.0, 3.0), 1.0, 1.0, events=event)
    known = zeros(omega, phase, 3.0)
    # Rounding decides about a zero at either end.
    known = known[(known > 1e-9) & (known < 3.0 - 1e-9)]
    if direction:
        known = known[np.sign(np.cos(omega * known + phase)) == direction]
    inside = [t for t in found.t_events[0] if 1e-9 < t < 3.0 - 1e-9]
    assert inside == pytest.approx(known, abs=1e-13)


@given(st.floats(0.5, 30.0), st.floats(-3.1, 3.1), st.floats(-0.999, 0.999))
def test_crossings_of_a_level_by_the_solution_are_all_found(omega, phase, level):
    def event(t, y):
        return y[0] - level

    found = solved(omega, phase, 4.0, events=event, dense_output=True)
    # sin x = level twice a turn.
    turns = 2.0 * np.pi * np.arange(-2, 30)
    angles = np.concatenate([turns + np.arcsin(level), turns + np.pi - np.arcsin(level)])
    known = np.sort((angles - phase) / omega)
    near = 1e-4 / omega
    known = known[(known > -near) & (known < 4.0 + near)]
    inside = known[(known > near) & (known < 4.0 - near)]
    times = found.t_events[0]
    assert len(inside) <= len(times) <= len(known)
    assert all(np.abs(times - time).min() < near for time in inside)
    assert np.abs(found.sol(times)[0] - level).max(initial=0.0) < 1e-13


def test_a_pair_of_crossings_as_close_as_rounding_allows():
    # y = t (2 - t) reaches 1 - h^2 at 1 - h and at 1 + h.
    for h in (0.1, 1e-3, 1e-5, 3e-7):
        found = dtm.solve_dde(
            lambda t, y, z: 2.0 - 2.0 * t + 0.0 * y,
            (0, 2),
            0.0,
            3.0,
            vectorized=True,
            events=lambda t, y, h=h: y[0] - 1.0 + h * h,
        )
        assert found.t_events[0] == pytest.approx([1.0 - h, 1.0 + h], abs=1e-15 / h)


def test_what_only_touches_zero_is_no_event():
    for event in (lambda t, y: np.sin(7.0 * t) ** 2, lambda t, y: (t - 1.234567) ** 2):
        assert dtm.solve_dde(rest, (0, 3), 1.0, 1.0, events=event).t_events[0].size <= 1
    # Zero at the start is none, zero at the end is one.
    found = dtm.solve_dde(rest, (0, 3), 1.0, 1.0, events=lambda t, y: t * (t - 3.0))
    assert list(found.t_events[0]) == [3.0]


def test_events_with_kinks_and_steps():
    events = [
        lambda t, y: abs(t - 1.3) - 0.01,
        lambda t, y: 1.0 if t < 0.777 else -1.0,
        lambda t, y: (t % 0.5) - 0.25,
        lambda t, y: np.sin(11.0 * t) * np.cos(t) ** 3 + 0.2,
    ]
    found = dtm.solve_dde(rest, (0, 3), 1.0, 1.0, events=events)
    kinked, step, sawtooth, product = found.t_events
    assert kinked == pytest.approx([1.29, 1.31], abs=1e-14)
    assert step == pytest.approx([0.777], abs=1e-14)
    assert sawtooth == pytest.approx(0.25 * np.arange(1, 13), abs=1e-14)
    t = np.linspace(0.0, 3.0, 300_001)
    signs = np.signbit(np.sin(11.0 * t) * np.cos(t) ** 3 + 0.2)
    assert product == pytest.approx(t[1:][signs[1:] != signs[:-1]], abs=1.1e-5)


# --- at jumps -------------------------------------------------------------------------------


def jumping(event, change, **options):
    jump = 0.5 if change is None else (0.5, change)
    return dtm.solve_dde(rest, (0, 1), 1.0, 1.0, jumps=[jump], events=event, **options)


@pytest.mark.parametrize("change", [None, lambda t, y: y + 1.0])
def test_an_event_at_the_time_of_a_jump_is_found_once(change):
    def event(t, y):
        return t - 0.5

    assert list(jumping(event, change).t_events[0]) == [0.5]
    event.terminal = True
    found = jumping(event, change, t_eval=[0.25, 0.5, 0.75])
    assert found.status == 1
    assert list(found.t) == [0.25, 0.5]


def test_a_change_across_zero_is_an_event():
    def event(t, y):
        return y[0] - 1.5

    found = jumping(event, lambda t, y: y + 1.0)
    assert list(found.t_events[0]) == [0.5]
    assert found.y_events[0][0, 0] == 2.0
    event.direction = -1
    assert jumping(event, lambda t, y: y + 1.0).t_events[0].size == 0
    event.direction, event.terminal = 1, True
    found = jumping(event, lambda t, y: y + 1.0)
    assert (found.status, found.t[-1], found.y[0, -1]) == (1, 0.5, 2.0)


def test_crossings_before_at_and_after_a_jump_are_counted_in_order():
    # y = t up to 1, then falls by 1.5 and rises again: zero of y - 0.75 up, down by the jump, up.
    def event(t, y):
        return y[0] - 0.75

    def run(terminal):
        event.terminal = terminal
        return dtm.solve_dde(
            lambda t, y, z: 1.0 + 0.0 * z[0],
            (0, 3),
            0.0,
            1.0,
            jumps=[(1.0, lambda t, y: y - 1.5)],
            events=[event, lambda t, y: t - 1.0],
        )

    found = run(0)
    assert found.t_events[0] == pytest.approx([0.75, 1.0, 2.25], abs=1e-14)
    assert list(found.t_events[1]) == [1.0]
    assert run(2).t[-1] == 1.0
    assert run(3).t[-1] == pytest.approx(2.25, abs=1e-14)


@given(st.lists(st.floats(0.05, 2.95), min_size=1, max_size=6, unique=True), st.floats(0.1, 0.9))
def test_signs_between_events_alternate(times, level):
    # A telegraph: each jump changes the sign of y.
    times = sorted(times)
    found = dtm.solve_dde(
        rest,
        (0, 3),
        1.0,
        1.0,
        jumps=[(time, lambda t, y: -y) for time in times],
        events=[lambda t, y: y[0], lambda t, y: y[0] - level],
    )
    assert list(found.t_events[0]) == times
    assert list(found.t_events[1]) == times


def test_what_is_narrower_than_the_stated_resolution_takes_max_step():
    def pulse(t, y):
        return np.exp(-(((t - 1.234) / 1e-3) ** 2)) - 0.5

    found = dtm.solve_dde(rest, (0, 3), 1.0, 1.0, events=pulse, max_step=0.01)
    half = 1e-3 * np.sqrt(np.log(2.0))
    assert found.t_events[0] == pytest.approx([1.234 - half, 1.234 + half], abs=1e-12)
