//! What delays that change from command to command do to the rows.
//!
//! To first order, a command that comes later by w s moves the output as its jump times −w would move
//! the slope of the response. Delays that are a sum of waves over the commands therefore add a column
//! for each wave, which is whitened as the rows are; what the unknowns of the mean follow is taken off.

use super::likelihood::{Counts, Through, Whitening, check_count, clear};
use super::mean::{Derivatives, Gain, Mean, Values, base_of, sizes};
use super::orthogonal::Triangle;
use super::path::{Held, respond};
use super::plant::{Plant, PlantSpace};
use super::rows::Rows;
use crate::{Error, Task, memory};

/// What memory is asked for.
const WHAT: &str = "the changes of the rows by waves of the delay";

/// Share of a column that the unknowns of the mean have to leave.
const LEFT: f64 = 1e-3;

/// The changes of the rows by waves of the delay, Q R with orthonormal columns Q, in deviations of the
/// white noise. The columns of waves that the unknowns of the mean follow are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Waves {
    /// R, square and upper triangular, row-major.
    pub factor: Vec<f64>,
    /// The residuals along Q.
    pub along: Vec<f64>,
    /// Sum of squares of the residuals: rows less unknowns of the mean.
    pub freedom: usize,
}

/// These waves, each with a value in s for each command, one wave after the other.
pub(super) fn waves(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    through: &Through,
    by: &Derivatives,
    waves: &[f64],
    task: &Task,
) -> Result<Waves, Error> {
    let (n, commands) = (rows.time.len(), rows.commands.time.len());
    let number = waves.len() / commands;
    refuse_if!(
        waves.len() != number * commands,
        "{} values of waves for {commands} commands: give one of each wave for each command",
        waves.len()
    );
    if let Some(value) = waves.iter().find(|value| !value.is_finite()) {
        refuse!("a wave has the value {value}: give finite numbers");
    }
    check_count(rows, values, by)?;
    let (_, count) = sizes(rows, values, by);
    let space = plant.space(&values.lags, values.zero);
    let mut mean = Mean::new(rows, plant, &space, values, by, task)?;
    let counts = Counts::of(rows, &mut mean, values, count);
    // The columns of the mean, of the waves, and of the output.
    let end = count * n;
    let output = memory::copied(WHAT, &mean.columns[end..])?;
    let mut columns = mean.columns;
    columns.truncate(end);
    let own = later(rows, plant, &space, values.delay, waves, task)?;
    memory::append(WHAT, &mut columns, &own)?;
    memory::append(WHAT, &mut columns, &output)?;
    drop((own, output));
    if let Some(whitening) = Whitening::new(rows, plant, &space, values, through)? {
        whitening.whiten(&mut columns, task)?;
    }
    let all = count + number;
    let triangle = Triangle::new(&columns, n, all + 1, task)?;
    let recorded = triangle.column(all);
    let gain = match values.gain {
        Gain::Eliminated => triangle.solve(&recorded[..counts.linear]).first().copied(),
        Gain::Searched(gain) | Gain::Known(gain) => Some(gain),
    };
    let squares: f64 = recorded[count..].iter().map(|e| e * e).sum();
    let freedom = counts.used - count;
    let deviation = (squares / freedom as f64).sqrt().max(f64::MIN_POSITIVE);
    let mut factor = memory::filled(WHAT, 0.0, number * number)?;
    let size = |entries: &[f64]| entries.iter().map(|e| e * e).sum::<f64>().sqrt();
    for wave in 0..number {
        let column = triangle.column(count + wave);
        if size(&column[count..]) <= LEFT * size(&column[counts.linear..]) {
            continue;
        }
        let places = factor[wave..].iter_mut().step_by(number);
        for (place, entry) in places.zip(&column[count..]) {
            *place = entry * gain.unwrap_or(0.0) / deviation;
        }
    }
    let along = recorded[count..all].iter().map(|e| e / deviation);
    Ok(Waves {
        factor,
        along: along.collect(),
        freedom,
    })
}

/// The change of the output of a plant of unit gain by each of the waves; zero in rows not used.
fn later(
    rows: &Rows,
    plant: &Plant,
    space: &PlantSpace,
    delay: f64,
    waves: &[f64],
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let (n, commands) = (rows.time.len(), &rows.commands);
    let size = commands.time.len();
    let mut found = memory::filled(WHAT, 0.0, (waves.len() / size).saturating_mul(n))?;
    let mut response = memory::filled(WHAT, 0.0, n)?;
    let mut moved = memory::filled(WHAT, 0.0, size)?;
    for (wave, change) in waves.chunks_exact(size).zip(found.chunks_exact_mut(n)) {
        let (mut before, mut sum) = (base_of(plant, rows), 0.0);
        for ((moved, wave), value) in moved.iter_mut().zip(wave).zip(&commands.value) {
            sum -= wave * (value - before);
            before = *value;
            *moved = sum;
        }
        let held = Held {
            time: &commands.time,
            value: &moved,
        };
        let (out, slope) = (response.as_mut_slice(), Some(&mut *change));
        respond([space], held, delay, &rows.time, [out], slope, task)?;
        clear(change, &rows.used);
    }
    Ok(found)
}

#[cfg(test)]
mod tests;
