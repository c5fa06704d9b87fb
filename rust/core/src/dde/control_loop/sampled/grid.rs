//! Poles of many sampled loops at once, for stability maps.
//!
//! A cell is one loop. Its model is read from arrays with either one entry for all cells or one
//! entry for each cell, so that a map over gains shares A, B and the delay. Each cell is computed
//! alone, so that results have the same bits for any number of threads. A pole violates a decay σ
//! if it lies outside the circle |z| = e^(−σ Ts).

use crate::dde::control_loop::linear_loop::{Equations, LinearLoop};
use crate::parallel;
use crate::status::CellStatus;
use crate::{Error, Task, memory};

use super::transition::{Sample, check_size, eigenvalues};

/// Distance of |z| from the circle, relative to the larger of it and 1, below which rounding errors
/// of the eigenvalues hide the side.
const ON_THE_CIRCLE: f64 = 1e-12;

/// Cells in one task of a thread.
const CHUNK: usize = 64;

/// Models of many loops with one sample time; every array is one entry or `cells` entries long.
#[derive(Debug, Clone, Copy)]
pub struct LoopCells<'a> {
    /// Number of cells.
    pub cells: usize,
    /// Number of states.
    pub states: usize,
    /// A, n × n an entry.
    pub a: &'a [f64],
    /// B, n an entry.
    pub b: &'a [f64],
    /// K, n an entry.
    pub k: &'a [f64],
    /// L.
    pub l: &'a [f64],
    /// Factor on B.
    pub gain: &'a [f64],
    /// Delay, s.
    pub delay: &'a [f64],
    /// Sample time, s.
    pub sample_time: &'a [f64],
}

/// Result for one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellPoles {
    /// ln(ρ)/Ts with ρ the largest |z|, 1/s.
    pub abscissa: f64,
    /// Number of poles outside the circle.
    pub unstable: i32,
    /// Is the count certain?
    pub status: CellStatus,
}

/// Abscissa of every cell, and number of its poles that decay more slowly than e^(−`decay` t).
///
/// # Errors
/// [`Error::Argument`] for arrays of other lengths or models without sense; [`Error::Interrupted`].
pub fn abscissa_grid(
    cells: &LoopCells<'_>,
    decay: f64,
    task: &Task,
) -> Result<Vec<CellPoles>, Error> {
    let rows = cells.rows()?;
    let shared = if rows.model_is_shared() {
        Some(rows.sample(0)?)
    } else {
        None
    };
    let unknown = CellPoles {
        abscissa: f64::NAN,
        unstable: 0,
        status: CellStatus::Undecided,
    };
    let mut found = memory::filled("the map", unknown, cells.cells)?;
    parallel::each("the map", found.chunks_mut(CHUNK), |chunk, places| {
        task.check()?;
        for (i, place) in places.iter_mut().enumerate() {
            *place = rows.cell(chunk * CHUNK + i, decay, shared.as_ref())?;
        }
        task.advance(places.len() as u64);
        Ok(())
    })?;
    Ok(found)
}

/// An array with one entry, or one entry a cell.
#[derive(Debug, Clone, Copy)]
struct Rows<'a> {
    data: &'a [f64],
    width: usize,
    step: usize,
}

impl<'a> Rows<'a> {
    fn new(name: &str, data: &'a [f64], width: usize, cells: usize) -> Result<Self, Error> {
        let step = if data.len() == width {
            0
        } else if data.len() == width * cells {
            width
        } else {
            refuse!(
                "{name} has {} elements: give {width} for all cells or {} for {cells} cells",
                data.len(),
                width * cells
            );
        };
        Ok(Self { data, width, step })
    }

    fn at(&self, cell: usize) -> &'a [f64] {
        &self.data[cell * self.step..cell * self.step + self.width]
    }

    fn number(&self, cell: usize) -> f64 {
        self.at(cell).first().copied().unwrap_or(f64::NAN)
    }

    fn is_shared(&self) -> bool {
        self.step == 0
    }
}

struct AllRows<'a> {
    a: Rows<'a>,
    b: Rows<'a>,
    k: Rows<'a>,
    l: Rows<'a>,
    scale: Rows<'a>,
    delay: Rows<'a>,
    sample_time: Rows<'a>,
}

impl<'a> LoopCells<'a> {
    fn rows(&self) -> Result<AllRows<'a>, Error> {
        let (n, cells) = (self.states, self.cells);
        Ok(AllRows {
            a: Rows::new("A", self.a, n * n, cells)?,
            b: Rows::new("B", self.b, n, cells)?,
            k: Rows::new("K", self.k, n, cells)?,
            l: Rows::new("L", self.l, 1, cells)?,
            scale: Rows::new("the factor on B", self.gain, 1, cells)?,
            delay: Rows::new("delay", self.delay, 1, cells)?,
            sample_time: Rows::new("sample_time", self.sample_time, 1, cells)?,
        })
    }
}

impl AllRows<'_> {
    fn model_is_shared(&self) -> bool {
        [self.a, self.b, self.delay, self.sample_time]
            .iter()
            .all(Rows::is_shared)
    }

    fn sample(&self, cell: usize) -> Result<Sample, Error> {
        let (delay, sample_time) = (self.delay.number(cell), self.sample_time.number(cell));
        let (a, b) = (self.a.at(cell), self.b.at(cell));
        // The checks of a loop's constructor, on the parts that decide the sample's model.
        LinearLoop::new(
            Equations {
                a: a.to_vec(),
                b: b.to_vec(),
                e: vec![0.0; b.len()],
                k: self.k.at(cell).to_vec(),
                l: self.l.number(cell),
                c: vec![0.0; b.len()],
                ..Equations::default()
            },
            delay,
            Some(sample_time),
            None,
        )?;
        check_size(b.len(), delay, sample_time)?;
        Ok(Sample::new(a, b, delay, sample_time))
    }

    fn cell(&self, cell: usize, decay: f64, shared: Option<&Sample>) -> Result<CellPoles, Error> {
        let own;
        let sample = if let Some(sample) = shared {
            sample
        } else {
            own = self.sample(cell)?;
            &own
        };
        let matrix = sample.close(
            self.k.at(cell),
            self.l.number(cell),
            self.scale.number(cell),
        );
        if matrix.iter().any(|entry| !entry.is_finite()) {
            return Ok(CellPoles {
                abscissa: f64::NAN,
                unstable: 0,
                status: CellStatus::Undecided,
            });
        }
        let sizes: Vec<f64> = eigenvalues(matrix, sample.states(), sample.size())?
            .iter()
            .map(|z| z.norm())
            .collect();
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        let circle = (-decay * self.sample_time.number(cell)).exp();
        let outside = sizes.iter().filter(|&&size| size > circle).count();
        let touching = sizes
            .iter()
            .any(|size| (size - circle).abs() <= ON_THE_CIRCLE * circle.max(1.0));
        Ok(CellPoles {
            abscissa: largest.ln() / self.sample_time.number(cell),
            unstable: i32::try_from(outside).unwrap_or(i32::MAX),
            status: if touching {
                CellStatus::Boundary
            } else {
                CellStatus::Ok
            },
        })
    }
}
