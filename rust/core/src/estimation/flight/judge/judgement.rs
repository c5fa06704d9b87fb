//! All tests of a fit, in the order in which they are told.

use super::super::fit::{FlightFit, FlightRun};
use super::super::intervals::FlightProfile;
use super::super::tolerances::INTERVALS;
use super::agreement::contradictions;
use super::air::{air_at_rest, restless_air};
use super::change::delay_change;
use super::colour::{is_coloured_at_rest, used};
use super::finding::{Cause, Finding, finding};
use super::lag::{below_zero, further_lag, overshoots};
use super::speed::grows_with_speed;
use super::tolerances::{LEVELS, REST, WHITE};
use super::whiteness::{Whiteness, whiteness};
use crate::estimation::likelihood::Evaluation;
use crate::estimation::point::Quantity;
use crate::{Error, Task};

/// What is asked about a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Asked<'a> {
    /// Are the commands given, not functions of the plant that is fitted?
    pub commands_given: bool,
    /// Can intervals be made valid for residuals that are coloured at rest, too?
    pub widens: bool,
    /// The interval of delay and lags together, where a further lag may not move it out.
    pub total: Option<(f64, f64)>,
    /// What the fit has intervals of; recordings have to agree about gain and total.
    pub quantities: &'a [Quantity],
}

/// What the tests say.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// Of the whitened residuals.
    pub whiteness: Whiteness,
    /// Do the whitened residuals have a colour that is there while the vehicle rests, too? Then the
    /// intervals have to be made valid for it.
    pub is_coloured: bool,
    /// What each test says; none speaks against a fit that holds.
    pub findings: Vec<Finding>,
}

/// Test the fit of a profile; whether its intervals can be made valid for residuals that are coloured at
/// rest, too, depends on who asks.
///
/// # Errors
///
/// As for `judge`.
pub fn judge_profile(
    profile: &FlightProfile,
    widens: bool,
    task: &Task,
) -> Result<Judgement, Error> {
    let quantities: Vec<Quantity> = profile.known.iter().map(|known| known.quantity).collect();
    let commands_given = !profile.is_of_plant;
    let has_total = commands_given && !profile.is_long() && quantities.contains(&Quantity::Total);
    let total = if has_total {
        Some(profile.interval(Quantity::Total, INTERVALS.level, task)?)
    } else {
        None
    };
    let asked = Asked {
        commands_given,
        widens: widens && commands_given && profile.numbers.is_none(),
        total,
        quantities: &quantities,
    };
    judge(&profile.fit, &asked, task)
}

/// Test a fit.
///
/// # Errors
///
/// As for `Model::at`.
fn judge(fit: &FlightFit, asked: &Asked<'_>, task: &Task) -> Result<Judgement, Error> {
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
