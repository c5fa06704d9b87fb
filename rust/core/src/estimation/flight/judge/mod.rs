//! Is a fit adequate? Tests under the noise of a flight, at the 1 % level by default.
//!
//! Beside the whiteness of the whitened residuals, these are tested:
//!
//! * a further lag beside the noise, and one with a zero, and a delay at its bound (`lag`);
//! * a delay that is constant over the window (`change`);
//! * air that is slower than the rows, and as large while the vehicle rests (`air`);
//! * where the residuals are not white, a colour that is the same while the vehicle rests (`colour`);
//! * noise that does not grow with the speed of the output (`speed`);
//! * recordings that agree about gain, and delay and lag together (`agreement`).
//!
//! `power` is what the test for a lag would have seen.

mod agreement;
mod air;
mod change;
mod colour;
mod draws;
mod lag;
mod motion;
mod pairs;
mod power;
mod speed;
mod tolerances;
mod whiteness;

pub use colour::colour_factors;
pub use power::unseen_lag;
pub use whiteness::{Whiteness, whiteness};

use super::fit::{FlightFit, FlightRun};
use crate::estimation::likelihood::Evaluation;
use crate::estimation::point::Quantity;
use crate::{Error, Task};
use agreement::contradictions;
use air::{air_at_rest, restless_air};
use change::delay_change;
use colour::{is_coloured_at_rest, used};
use lag::{below_zero, further_lag, overshoots};
use speed::grows_with_speed;
use tolerances::{LEVELS, REST, WHITE};

/// Level of each test: this share of right fits is called wrong by it.
pub const LEVEL_OF_TESTS: f64 = LEVELS.test;

/// What is asked about a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked<'a> {
    /// Are the commands given, not functions of the plant that is fitted?
    pub commands_given: bool,
    /// Can intervals be made valid for residuals that are coloured at rest, too?
    pub widens: bool,
    /// The interval of delay and lags together, where a further lag may not move it out.
    pub total: Option<(f64, f64)>,
    /// What the fit has intervals of; recordings have to agree about gain and total.
    pub quantities: &'a [Quantity],
}

/// What may speak against a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// The residuals are not white: their autocorrelation.
    Colour,
    /// The plant lacks a lag: its size, s.
    Lag,
    /// A lag would move delay and lags out of their interval: its size and their sum then, s.
    LagMoves,
    /// The plant lacks a lag with a zero: their sizes, s.
    Overshoot,
    /// The delay is at zero, and the slope of the likelihood leads below it.
    BelowZero,
    /// The delay changes: its standard deviation, s.
    Change,
    /// The noise grows with the speed of the output.
    Speed,
    /// Air that changes within a row moves the output: by so many deviations of the sensor.
    RestlessAir,
    /// Air moves the output more while the vehicle moves.
    MovingAir,
    /// The gains of recordings differ: each with its standard error.
    Gains,
    /// Their sums of delay and lags differ: each with its standard error, s.
    Totals,
}

impl Cause {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Colour => "colour",
            Self::Lag => "lag",
            Self::LagMoves => "lag moves",
            Self::Overshoot => "overshoot",
            Self::BelowZero => "below zero",
            Self::Change => "change",
            Self::Speed => "speed",
            Self::RestlessAir => "restless air",
            Self::MovingAir => "moving air",
            Self::Gains => "gains",
            Self::Totals => "totals",
        }
    }
}

/// What one test says.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What was tested.
    pub cause: Cause,
    /// The recording, where one alone was tested.
    pub run: Option<usize>,
    /// Its sizes, as the cause has them.
    pub sizes: Vec<f64>,
    /// Probability of as much where the fit is right; not a number where a size alone decides.
    pub p_value: f64,
    /// Does it speak against the fit?
    pub is_against: bool,
    /// Does it then say that the plant lacks something: a lag, or what the air stands for?
    pub plant_lacks: bool,
}

/// What the tests say.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// Of the whitened residuals.
    pub whiteness: Whiteness,
    /// Do the whitened residuals have a colour that is there while the vehicle rests, too? Then the
    /// intervals have to be made valid for it.
    pub is_coloured: bool,
    /// What each test says; none speaks against a fit that is adequate.
    pub findings: Vec<Finding>,
}

/// Test a fit.
///
/// # Errors
///
/// As for `Model::at`.
pub fn judge(fit: &FlightFit, asked: &Asked<'_>, task: &Task) -> Result<Judgement, Error> {
    let parts = fit.parts(task)?;
    let pieces = fit.runs.iter().zip(parts);
    let pieces: Vec<Vec<f64>> = pieces
        .map(|(run, part)| used(&part.whitened, &run.rows.used))
        .collect();
    let borrowed: Vec<&[f64]> = pieces.iter().map(Vec::as_slice).collect();
    let whiteness = whiteness(&borrowed, 0);
    let differs = !whiteness.is_white() && !fit.runs.iter().zip(parts).all(is_rounding);
    let is_coloured = differs && asked.widens && is_coloured_at_rest(fit, task)?;
    let mut tests = Tests {
        fit,
        is_coloured,
        findings: Vec::new(),
    };
    tests.add(Finding {
        sizes: vec![whiteness.autocorrelation],
        is_against: differs && !is_coloured,
        ..finding(Cause::Colour, whiteness.p_value)
    });
    tests.lags(asked, task)?;
    tests.add(Finding {
        plant_lacks: true,
        ..finding(Cause::BelowZero, below_zero(fit, task)?)
    });
    for (run, whitened) in pieces.iter().enumerate() {
        task.check()?;
        tests.of_run(run, whitened, asked, task)?;
    }
    for (cause, p_value, sizes) in contradictions(fit, asked.quantities, task)? {
        tests.add(Finding {
            sizes,
            ..finding(cause, p_value)
        });
    }
    Ok(Judgement {
        whiteness,
        is_coloured,
        findings: tests.findings,
    })
}

/// What a test at the level of each says.
fn finding(cause: Cause, p_value: f64) -> Finding {
    Finding {
        cause,
        run: None,
        sizes: Vec::new(),
        p_value,
        is_against: p_value < LEVELS.test,
        plant_lacks: false,
    }
}

/// Are residuals those of rounding, which is not white because it follows the output?
fn is_rounding((run, part): (&FlightRun, &Evaluation)) -> bool {
    let residuals = used(&part.residuals, &run.rows.used);
    let count = residuals.len() as f64;
    let mean = residuals.iter().sum::<f64>() / count;
    let squares: f64 = residuals.iter().map(|x| (x - mean) * (x - mean)).sum();
    (squares / count).sqrt() < WHITE.rounding * run.rounding / 12.0_f64.sqrt()
}

/// What was tested so far.
struct Tests<'a> {
    fit: &'a FlightFit,
    is_coloured: bool,
    findings: Vec<Finding>,
}

impl Tests<'_> {
    fn add(&mut self, finding: Finding) {
        self.findings.push(finding);
    }

    /// A lag that the plant lacks, alone or with a zero.
    fn lags(&mut self, asked: &Asked<'_>, task: &Task) -> Result<(), Error> {
        let fit = self.fit;
        let richer = further_lag(fit, task)?;
        let total = richer.point.total() + fit.plant.own_lag;
        let lacks = richer.p_value < level_of_lag(fit);
        let moves = asked
            .total
            .is_some_and(|(low, high)| !(low..=high).contains(&total));
        let moves = !lacks && richer.p_value < LEVELS.moves && moves;
        self.add(Finding {
            sizes: vec![richer.lag()],
            is_against: lacks,
            // Between the levels there is doubt, and the fit is the best there is all the same.
            plant_lacks: richer.p_value < LEVELS.test,
            ..finding(Cause::Lag, richer.p_value)
        });
        if moves {
            self.add(Finding {
                sizes: vec![richer.lag(), total],
                is_against: true,
                plant_lacks: true,
                ..finding(Cause::LagMoves, richer.p_value)
            });
        }
        if self.is_coloured && !lacks && !moves {
            let richer = overshoots(fit, task)?;
            self.add(Finding {
                sizes: vec![richer.lag(), richer.point.zero],
                plant_lacks: true,
                ..finding(Cause::Overshoot, richer.p_value)
            });
        }
        Ok(())
    }

    /// What is tested in each recording.
    fn of_run(
        &mut self,
        run: usize,
        whitened: &[f64],
        asked: &Asked<'_>,
        task: &Task,
    ) -> Result<(), Error> {
        let fit = self.fit;
        // Commands that follow from the plant move with its numbers, which the test does not know.
        if asked.commands_given {
            let change = delay_change(fit, run, task)?;
            self.add(Finding {
                run: Some(run),
                sizes: vec![change.spread],
                ..finding(Cause::Change, change.p_value)
            });
        }
        let rate = used(&fit.parts(task)?[run].rate, &fit.runs[run].rows.used);
        let grows = grows_with_speed(whitened, &rate, self.is_coloured);
        self.add(Finding {
            run: Some(run),
            ..finding(Cause::Speed, grows)
        });
        let share = restless_air(fit, run);
        self.add(Finding {
            run: Some(run),
            sizes: vec![share],
            is_against: share > REST.restless,
            plant_lacks: true,
            ..finding(Cause::RestlessAir, f64::NAN)
        });
        self.add(Finding {
            run: Some(run),
            plant_lacks: true,
            ..finding(Cause::MovingAir, air_at_rest(fit, run, task)?)
        });
        Ok(())
    }
}

/// Level of the test for a further lag.
fn level_of_lag(fit: &FlightFit) -> f64 {
    let has_lag = fit.fit.point.lags.iter().any(|lag| *lag != 0.0) || fit.plant.own_lag > 0.0;
    let is_in_air = fit.noises().iter().any(|noise| noise.air > 0.0);
    if is_in_air && !has_lag {
        LEVELS.lag_in_air
    } else {
        LEVELS.test
    }
}
