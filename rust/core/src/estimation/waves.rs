//! What delays that change from command to command do to the rows.
//!
//! To first order, a command that comes later by w s moves the output as its jump times −w would move
//! the slope of the response. Delays that are a sum of waves over the commands, with 1, 2, ... half
//! periods from the first row to the last, therefore add a column for each wave, which is whitened as
//! the rows are; what the unknowns of the mean follow is taken off.

use std::f64::consts::PI;

use super::likelihood::{Counts, Through, Whitening, check_count, clear};
use super::mean::{Derivatives, Gain, Mean, Values, base_of, sizes};
use super::path::{Held, respond};
use super::plant::{Plant, PlantSpace};
use super::rows::Rows;
use crate::linear_algebra::triangle::Triangle;
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

/// So many waves, each of 1 s.
pub(super) fn waves(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    through: &Through,
    by: &Derivatives,
    number: usize,
    task: &Task,
) -> Result<Waves, Error> {
    let n = rows.time.len();
    check_count(rows, values, by)?;
    let (_, count) = sizes(rows, values, by);
    let space = plant.space(&values.lags, values.zero);
    let mut mean = Mean::new(rows, plant, &space, values, by, task)?;
    let counts = Counts::of(rows, &mut mean, values, count);
    // The columns of the mean, of the waves, and of the output.
    let end = count * n;
    let output = memory::copied(WHAT, &mean.columns[end..])?;
    let mut columns = memory::reserved(WHAT, (count + number + 1).saturating_mul(n))?;
    memory::append(WHAT, &mut columns, &mean.columns[..end])?;
    drop(mean);
    for wave in 1..=number {
        let own = later(rows, plant, &space, values.delay, wave, task)?;
        memory::append(WHAT, &mut columns, &own)?;
    }
    memory::append(WHAT, &mut columns, &output)?;
    drop(output);
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

/// The change of the output of a plant of unit gain by a wave; zero in rows not used.
fn later(
    rows: &Rows,
    plant: &Plant,
    space: &PlantSpace,
    delay: f64,
    wave: usize,
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let commands = &rows.commands;
    let mut response = memory::filled(WHAT, 0.0, rows.time.len())?;
    let mut change = memory::filled(WHAT, 0.0, rows.time.len())?;
    let (mut before, mut sum) = (base_of(plant, rows), 0.0);
    let moved = commands
        .time
        .iter()
        .zip(&commands.value)
        .map(|(time, value)| {
            let share = ((time - rows.time[0]) / rows.span()).clamp(0.0, 1.0);
            sum -= (PI * wave as f64 * share).cos() * (value - before);
            before = *value;
            sum
        });
    let moved = memory::collected(WHAT, moved)?;
    let held = Held {
        time: &commands.time,
        value: &moved,
    };
    let (out, slope) = (response.as_mut_slice(), Some(change.as_mut_slice()));
    respond([space], held, delay, &rows.time, [out], slope, task)?;
    clear(&mut change, &rows.used);
    Ok(change)
}

#[cfg(test)]
mod tests;
