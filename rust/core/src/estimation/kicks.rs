//! Random changes of the states of a plant at the arrivals of commands.

use super::plant::{MOST_STATES, PlantSpace};
use super::rows::{Commands, Rows};
use super::steps::Steps;
use super::whiten::Kick;
use crate::{Error, memory};

/// What the errors of computed commands, and the scatter of the times at which commands arrive, do
/// to the states of the plant by the next row, in the order of the rows.
///
/// Commands are computed from outputs: their errors are in deviations of the whole `sensor` noise.
pub(super) fn kicks(
    rows: &Rows,
    space: &PlantSpace,
    delay: f64,
    arrivals: f64,
    sensor: f64,
) -> Result<Vec<Kick>, Error> {
    let mut found = match space.b.len() {
        0 => Ok(Vec::new()),
        1 => kicks_of::<1>(rows, space, delay, arrivals, sensor),
        2 => kicks_of::<2>(rows, space, delay, arrivals, sensor),
        3 => kicks_of::<3>(rows, space, delay, arrivals, sensor),
        4 => kicks_of::<4>(rows, space, delay, arrivals, sensor),
        5 => kicks_of::<5>(rows, space, delay, arrivals, sensor),
        6 => kicks_of::<6>(rows, space, delay, arrivals, sensor),
        7 => kicks_of::<7>(rows, space, delay, arrivals, sensor),
        8 => kicks_of::<8>(rows, space, delay, arrivals, sensor),
        n => refuse!("the plant has {n} states, but the likelihood can use at most 8"),
    }?;
    if arrivals > 0.0 && !rows.commands.uncertain.is_empty() {
        found.sort_by_key(|kick| kick.row);
    }
    Ok(found)
}

/// Those of `uncertain` commands, then those of the times of arrival.
fn kicks_of<const N: usize>(
    rows: &Rows,
    space: &PlantSpace,
    delay: f64,
    arrivals: f64,
    sensor: f64,
) -> Result<Vec<Kick>, Error> {
    let Commands {
        time,
        value,
        uncertain,
        ..
    } = &rows.commands;
    let jumps = if arrivals > 0.0 { time.len() - 1 } else { 0 };
    let mut found = memory::reserved("the errors of commands", uncertain.len() + jumps)?;
    let mut steps = Steps::<N, 1>::new([space]);
    // Ends come in their order, and so do the rows that follow them.
    let mut add = |steps: &mut Steps<N, 1>, row: &mut usize, end: f64, moved: &[f64; N]| {
        let arrival = end + delay;
        while rows.time.get(*row).is_some_and(|time| *time < arrival) {
            *row += 1;
        }
        let Some(time) = rows.time.get(*row).filter(|_| *row > 0) else {
            return;
        };
        let mut state = [0.0; MOST_STATES];
        state[..N].copy_from_slice(&steps.at(time - arrival, *time)[0].apply(moved, 0.0));
        found.push(Kick { row: *row, state });
    };
    let mut row = 0;
    for (start, end, deviation) in uncertain {
        let moved = steps.at(end - start, *end)[0].apply(&[0.0; N], sensor * deviation);
        add(&mut steps, &mut row, *end, &moved);
    }
    if arrivals > 0.0 {
        let mut row = 0;
        let by_jump: [f64; N] = std::array::from_fn(|i| space.b[i]);
        for (end, pair) in time.iter().skip(1).zip(value.windows(2)) {
            let jump = arrivals * (pair[1] - pair[0]);
            if jump != 0.0 {
                add(&mut steps, &mut row, *end, &by_jump.map(|b| b * jump));
            }
        }
    }
    Ok(found)
}
