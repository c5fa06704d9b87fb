//! The whole family fitted to one record: rows, minima, intervals, verdict.

use super::answer::{Family, check_level};
use super::candidate::Candidate;
use super::causes::with_smoothing;
use super::class::Class;
use super::excitation::{excited, is_one_sine};
use super::hull::{hull, turning};
use super::minima::{Minimum, Plan, minima, seeds_of, without_plant};
use super::noise::Noise;
use super::reach::{as_likely, catching_up, within_reach};
use super::refine::{Seed, beside};
use super::rows::{Part, Record, Rows, Start};
use super::sensors::without_faults;
use super::tolerances::{EVIDENCE, RANGES, STARTS};
use super::verdict::{Findings, shifted, verdict};
use crate::{Error, Task};

/// Rows that a fit needs beyond its numbers.
const FEWEST_ROWS: usize = 20;

/// What the largest delay is above those of the first pass, as a factor and in rows: more leaves out more
/// rows at the start, less may end at a delay that the noise of the first pass made too short.
const DELAY_LIMIT: (f64, f64) = (1.25, 3.0);

/// Numbers that one sine tells.
const TOLD_BY_SINE: usize = 2;

/// Delay, in rows, below which the command may have been logged late: more tries that more often.
const EARLY: f64 = 0.5;

/// How a command moves between its rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// It is held.
    Held,
    /// It is straight.
    Straight,
    /// Not known.
    Undecided,
}

/// What is asked.
#[derive(Debug, Clone)]
pub struct Question {
    /// How the command moves between rows.
    pub between: Between,
    /// Does a controller compute the command from the output?
    pub in_loop: bool,
    /// Is the plant at rest at the first row? None: as the record shows.
    pub at_rest: Option<bool>,
    /// Largest delay, s. None: from the record.
    pub largest_delay: Option<f64>,
    /// Only this class.
    pub class: Option<Class>,
    /// Only classes that integrate, or only those that come to rest.
    pub integrating: Option<bool>,
    /// Only this noise.
    pub noise: Option<Noise>,
    /// Level of the intervals.
    pub level: f64,
    /// Is what the plant lacks looked for?
    pub causes: bool,
}

/// Fit the family to records of one plant, each with its own start, level and size of noise.
///
/// # Errors
/// [`Error::Argument`] for numbers out of range or too few rows, and as a task ends.
pub fn fit_family(records: &[Record], question: &Question, task: &Task) -> Result<Family, Error> {
    if !question.causes {
        return of_readings(records, question, task);
    }
    let read = records.iter().enumerate();
    let (read, faults): (Vec<_>, Vec<_>) = read
        .map(|(place, record)| without_faults(record, place))
        .unzip();
    let mut out = of_readings(&read, question, task)?;
    out.sensor.extend(faults.concat());
    Ok(out)
}

/// Fit the family to records whose outputs are readings.
fn of_readings(records: &[Record], question: &Question, task: &Task) -> Result<Family, Error> {
    let starts = starts_of(records, question)?;
    let shortest = shortest(records);
    if let Some(delay) = question.largest_delay {
        refuse_if!(
            !(delay > 0.0 && delay <= shortest),
            "the largest delay is {delay} s: give a delay above 0 and below the length of the \
             recording, {shortest} s"
        );
    }
    check_level(question.level)?;
    let kinds: &[bool] = match question.between {
        Between::Held => &[false],
        Between::Straight => &[true],
        Between::Undecided if records.iter().all(Record::jumps) => &[false],
        Between::Undecided => &[false, true],
    };
    let mut found: Vec<Family> = Vec::with_capacity(kinds.len());
    for straight in kinds {
        let known = found.first();
        found.push(one_kind(
            records, question, &starts, *straight, known, task,
        )?);
    }
    // A controller and values that rest speak for a held command.
    let held = question.in_loop || records.iter().all(Record::rests);
    let out = joined(found, !held, task)?;
    moved(records, question, &starts, &out, task).map(|moved| moved.unwrap_or(out))
}

/// What is known of the plant at the first row of each record.
fn starts_of(records: &[Record], question: &Question) -> Result<Vec<Start>, Error> {
    refuse_if!(
        records.is_empty(),
        "no recording was given: give at least one"
    );
    let start = |record: &Record| match question.at_rest {
        Some(true) => Start::Rest,
        None if record.begins_at_rest() => Start::Held,
        _ => Start::Unknown,
    };
    Ok(records.iter().map(start).collect())
}

/// The length of the shortest record, s.
fn shortest(records: &[Record]) -> f64 {
    let spans = records.iter().map(Record::span);
    spans.fold(f64::INFINITY, f64::min)
}

fn check_rows(rows: &Rows, largest: f64) -> Result<(), Error> {
    for part in &rows.parts {
        refuse_if!(
            part.used.len() < FEWEST_ROWS,
            "only {} rows with a known output are later than the largest delay of {largest} s, \
             but a fit needs {FEWEST_ROWS}: give more rows, or a smaller largest delay",
            part.used.len()
        );
    }
    Ok(())
}

/// The plants that some records leave, fitted to more rows of the same plant: searched only beside the
/// numbers that are known, so that many rows take little time.
///
/// # Errors
/// As of [`fit_family`].
pub fn refine_family(
    known: &Family,
    records: &[Record],
    question: &Question,
    task: &Task,
) -> Result<Family, Error> {
    let starts = starts_of(records, question)?;
    let count = records.iter().map(|record| record.time.len()).sum();
    let known_plants = known.worth_refining(count).into_iter();
    let mut seeds: Vec<Seed> = known_plants
        .map(|one| (one.class, one.numbers, one.noise))
        .filter(|(class, ..)| question.class.is_none_or(|asked| asked == *class))
        .collect();
    let longest = seeds.iter().map(|(_, numbers, _)| numbers.delay);
    let longest = longest.fold(0.0, f64::max);
    let row = records.iter().map(Record::row).fold(0.0, f64::max);
    let largest = question.largest_delay.unwrap_or(known.largest_delay);
    let delay_limit = largest.min(DELAY_LIMIT.0 * longest + DELAY_LIMIT.1 * row);
    let mut rows = Rows::new(
        records,
        &starts,
        delay_limit,
        known.straight,
        question.in_loop,
    );
    check_rows(&rows, delay_limit)?;
    let mut rounds = 0;
    loop {
        let found = beside(&seeds, &rows, task)?;
        let now = weights_of(&found);
        if rounds < REWEIGHTED && differ(&now, &rows.weights) {
            let seed = |one: &Minimum<'_>| {
                let numbers = one.model.numbers(&one.point.x);
                (one.model.class, numbers, one.model.noise)
            };
            seeds = found.iter().map(seed).collect();
            rows.weights = now;
            rounds += 1;
            continue;
        }
        let mut out = answer(&found, f64::INFINITY, question, largest, task)?;
        (out.delay_limit, out.weights, out.decided) =
            (delay_limit, rows.weights.clone(), known.decided);
        return Ok(out);
    }
}

/// The more likely kind of command, or the `usual` one where it is as likely; where none is decided, its
/// intervals are those of both.
fn joined(mut found: Vec<Family>, usual: bool, task: &Task) -> Result<Family, Error> {
    let least = |family: &Family| {
        family
            .candidates
            .first()
            .map_or(f64::INFINITY, |one| one.deviance)
    };
    let floor = found
        .iter()
        .fold(f64::INFINITY, |floor, one| floor.min(least(one)));
    let is_usual = |one: &Family| one.straight == usual && least(one) < floor + EVIDENCE.tie;
    found.sort_by(|a, b| {
        let ranks = is_usual(b).cmp(&is_usual(a));
        ranks.then(least(a).total_cmp(&least(b)))
    });
    let mut kinds = found.into_iter();
    let mut out = kinds.next().ok_or_else(|| {
        Error::argument("give at least one kind of command: held, straight or samples")
    })?;
    for other in kinds {
        out.decided = least(&other) - least(&out) > EVIDENCE.likely;
        if !out.decided {
            out.minima.extend(other.minima);
            out.hull = hull(&turning(&out.minima, task)?, out.largest_delay);
        }
        for candidate in other.candidates {
            let is_known = out
                .candidates
                .iter()
                .any(|own| own.class == candidate.class);
            if !is_known {
                out.candidates.push(candidate);
            }
        }
    }
    out.candidates.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    Ok(out)
}

/// The family with the command a row earlier, where no delay is too much and that is better. In a
/// closed loop it would be the controller.
fn moved(
    records: &[Record],
    question: &Question,
    starts: &[Start],
    found: &Family,
    task: &Task,
) -> Result<Option<Family>, Error> {
    let Some(best) = found.candidates.first() else {
        return Ok(None);
    };
    let row = records.iter().map(Record::row).fold(0.0, f64::max);
    let own_times = records.iter().any(|record| record.sent.is_some());
    if question.in_loop || own_times || best.numbers.delay > EARLY * row {
        return Ok(None);
    }
    let mut earlier = records.to_vec();
    for record in &mut earlier {
        record.command.rotate_left(1);
        if let [.., before, last] = &mut record.command[..] {
            *last = *before;
        }
    }
    let mut out = one_kind(&earlier, question, starts, found.straight, None, task)?;
    let fall = out
        .candidates
        .first()
        .map_or(0.0, |own| best.deviance - own.deviance);
    out.shift = -1;
    out.decided = found.decided;
    out.verdict = shifted(out.verdict, fall);
    Ok((fall > EVIDENCE.shifted).then_some(out))
}

/// Classes that contain the best one and whose further number the record does not tell say nothing
/// new: their errors have no end, their likelihood is that of the best. Two numbers may be those of one
/// sine, and then they do.
fn leave_out_what_adds_nothing(minima: &mut Vec<Candidate>) {
    let Some(best) = minima.first().filter(|best| best.told >= EVIDENCE.enough) else {
        return;
    };
    let best = (best.class, best.deviance);
    minima.retain(|one| {
        one.class == best.0
            || !one.class.contains(best.0)
            || one.told == one.values.len()
            || best.1 - one.deviance > EVIDENCE.adds
    });
}

/// The classes and noises that are asked for.
fn asked(question: &Question) -> (Vec<Class>, Vec<Noise>) {
    let may_be = |class: &Class| {
        let is_kind = question
            .integrating
            .is_none_or(|kind| kind == class.integrating);
        is_kind && (!question.in_loop || class.integrating || class.order > 0)
    };
    let classes = match question.class {
        Some(class) => vec![class],
        None => Class::all().filter(may_be).collect(),
    };
    let noises = question
        .noise
        .map_or(Noise::ALL.to_vec(), |noise| vec![noise]);
    (classes, noises)
}

fn one_kind(
    records: &[Record],
    question: &Question,
    starts: &[Start],
    straight: bool,
    known: Option<&Family>,
    task: &Task,
) -> Result<Family, Error> {
    let largest = question
        .largest_delay
        .unwrap_or(RANGES.delay_share * shortest(records));
    let (mut classes, noises) = asked(question);
    let leads = |class: &Class| classes.iter().any(|asked| class.leads_to(*asked));
    let begun: Vec<Class> = Class::all().filter(leads).collect();
    let mut rows = Rows::new(records, starts, largest, straight, question.in_loop);
    check_rows(&rows, largest)?;
    let (mut delay_limit, mut seeds, mut weights);
    if let Some(known) = known {
        (delay_limit, seeds, weights) = (known.delay_limit, known.seeds(), known.weights.clone());
        classes.retain(|class| seeds.iter().any(|(own, _)| own == class));
    } else {
        let thin = rows.thinned(STARTS.thin);
        let white = Plan {
            rows: &thin,
            thin: &thin,
            classes: &classes,
            begun: &begun,
            noises: &[Noise::White],
            seeds: &[],
            grids: true,
        };
        let found = minima(&white, task)?;
        (delay_limit, seeds, weights) = (largest, seeds_of(&found), weights_of(&found));
        if starts.contains(&Start::Unknown) && question.largest_delay.is_none() {
            delay_limit =
                delay_limit.min(DELAY_LIMIT.0 * longest_delay(&found) + DELAY_LIMIT.1 * rows.row);
        }
    }
    let mut rounds = 0;
    loop {
        if delay_limit < rows.largest_delay {
            rows = Rows::new(records, starts, delay_limit, straight, question.in_loop);
        }
        rows.weights.clone_from(&weights);
        // What rows leave open of a command imitates causes.
        let open = straight && records.iter().any(|record| record.sent.is_some());
        rows.flexible = question.causes && !open;
        let thin = rows.thinned(STARTS.thin);
        let plan = Plan {
            rows: &rows,
            thin: &thin,
            classes: &classes,
            begun: &begun,
            noises: &noises,
            seeds: &seeds,
            grids: true,
        };
        let found = minima(&plan, task)?;
        // Coloured noise may need a longer delay than the white noise of the first pass.
        if delay_limit < largest && longest_delay(&found) >= delay_limit {
            delay_limit = largest.min(2.0 * delay_limit);
            rows = Rows::new(records, starts, delay_limit, straight, question.in_loop);
            continue;
        }
        let now = weights_of(&found);
        if rounds < REWEIGHTED && differ(&now, &weights) {
            (seeds, weights) = (seeds_of(&found), now);
            rounds += 1;
            continue;
        }
        let silent = without_plant(&plan, task)?;
        let answered = |found: &[Minimum<'_>]| answer(found, silent, question, largest, task);
        let mut out = answered(&found)?;
        if rows.flexible {
            out = with_smoothing(out, &plan, &found, &answered, task)?;
        }
        // Or a plant behind a cause.
        let is_late = out.candidates.first().and_then(|best| best.limit) == Some("delay");
        if delay_limit < largest && is_late {
            delay_limit = largest.min(2.0 * delay_limit);
            rows = Rows::new(records, starts, delay_limit, straight, question.in_loop);
            continue;
        }
        (out.delay_limit, out.weights) = (delay_limit, weights);
        return Ok(out);
    }
}

/// Most times that records are weighted anew, and the change of a weight that asks for it.
const REWEIGHTED: usize = 2;
const CHANGED: f64 = 0.1;

/// One over the noise of each record, as the best class leaves it; one record has the weight 1.
fn weights_of(found: &[Minimum<'_>]) -> Vec<f64> {
    match found.first() {
        Some(best) if best.model.rows.parts.len() > 1 => best.model.weights(&best.point),
        _ => vec![1.0],
    }
}

fn differ(new: &[f64], old: &[f64]) -> bool {
    let mut pairs = new.iter().zip(old);
    pairs.any(|(new, old)| (new / old - 1.0).abs() > CHANGED)
}

/// The longest delay of the minima that may be the true one, s.
fn longest_delay(found: &[Minimum<'_>]) -> f64 {
    let delays = within_reach(found).into_iter();
    delays.fold(0.0, |longest, at| longest.max(found[at].point.x[0]))
}

/// Those at some places.
fn chosen(all: &[Candidate], places: Vec<usize>) -> Vec<Candidate> {
    places.into_iter().map(|at| all[at].clone()).collect()
}

fn answer(
    found: &[Minimum<'_>],
    silent: f64,
    question: &Question,
    largest_delay: f64,
    task: &Task,
) -> Result<Family, Error> {
    let rows = found.first().map(|best| best.model.rows);
    let excited = rows.map_or(Vec::new(), excited);
    let is_sine = rows.is_some_and(|rows| is_one_sine(rows, &excited));
    let made = |one: &Minimum<'_>, may_be_wrong: bool| {
        let mut out = Candidate::new(one, question.level, may_be_wrong);
        if is_sine {
            out.told = out.told.min(TOLD_BY_SINE);
        }
        out
    };
    let all: Vec<Candidate> = found.iter().map(|one| made(one, false)).collect();
    let is_flexible = rows.is_some_and(|rows| rows.flexible);
    let near = within_reach(found);
    let reached = near.iter().map(|at| {
        if is_flexible {
            made(&found[*at], true)
        } else {
            all[*at].clone()
        }
    });
    let mut minima: Vec<Candidate> = reached.collect();
    let others = catching_up(found, &near, &minima).into_iter();
    minima.extend(others.map(|at| made(&found[at], true)));
    minima.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    // What is further behind in BIC, though more likely, counts where the record tells all of it.
    let reach = minima.first().map_or(0.0, |best| best.bic) + EVIDENCE.reach;
    let errs = minima.first().is_some_and(Candidate::errs);
    minima.retain(|one| one.bic <= reach || !errs && one.told == one.values.len());
    leave_out_what_adds_nothing(&mut minima);
    for own in &mut minima {
        let is_own = |one: &&Minimum<'_>| {
            (one.model.class, one.model.noise) == (own.class, own.noise)
                && one.deviance == own.deviance
        };
        if let Some(one) = found.iter().find(is_own) {
            own.follow_zero(one, task)?;
        }
    }
    let mut candidates: Vec<Candidate> = Vec::new();
    for one in &all {
        if candidates.iter().all(|known| known.class != one.class) {
            candidates.push(one.clone());
        }
    }
    // What the error of a class explains counts for it.
    for one in &mut candidates {
        let own = minima.iter().find(|own| own.class == one.class);
        one.bic = own.map_or(one.bic, |own| own.bic.min(one.bic));
    }
    candidates.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    let likely = chosen(&all, as_likely(found));
    let evidence = Findings {
        response: silent - found.first().map_or(f64::INFINITY, |best| best.bic),
        is_sine: is_sine && question.class.is_none(),
    };
    let parts = rows.map_or(&[][..], |rows| &rows.parts);
    let first = |part: &Part| part.used.first().copied();
    Ok(Family {
        verdict: verdict(&turning(&likely, task)?, &evidence),
        hull: hull(&turning(&minima, task)?, largest_delay),
        candidates,
        straight: rows.is_some_and(|rows| rows.straight),
        decided: true,
        at_rest: parts.iter().all(|part| part.start != Start::Unknown),
        rows: rows.map_or(0, Rows::count),
        first_rows: parts.iter().filter_map(first).collect(),
        shift: 0,
        excited,
        causes: Vec::new(),
        sensor: Vec::new(),
        largest_delay,
        delay_limit: largest_delay,
        weights: Vec::new(),
        minima,
    })
}
