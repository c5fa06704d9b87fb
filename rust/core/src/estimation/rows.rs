//! The rows of one recording and the commands it was given, checked.

use crate::Error;

/// What was sent to the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Commands {
    /// From when each command holds, s, increasing.
    pub time: Vec<f64>,
    /// The commands.
    pub value: Vec<f64>,
    /// Times between which the command is unknown: a linear unknown for each.
    pub unknown: Vec<(f64, f64)>,
    /// Times between which the command was computed, and its error: the standard deviation of the
    /// response it causes, as a factor on that of a unit command, in deviations of the noise of the
    /// sensor, white and coloured together. In the order of their ends.
    pub uncertain: Vec<(f64, f64, f64)>,
}

/// The rows of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    /// s, increasing.
    pub time: Vec<f64>,
    /// The output.
    pub output: Vec<f64>,
    /// Rows that are not used have no part in the likelihood.
    pub used: Vec<bool>,
    /// Slope of the response of the plant of unit gain at each row, by which a scatter of its time
    /// counts; may be empty.
    pub speed: Vec<f64>,
    /// The commands.
    pub commands: Commands,
    /// Is the output at the start unknown?
    pub offset: bool,
    /// Is there a constant input besides the command?
    pub trim: bool,
}

impl Rows {
    /// Rows that are all used, from an output at the start that is unknown, and commands from their
    /// times on.
    ///
    /// # Errors
    ///
    /// As for `checked`.
    pub fn new(
        (time, output): (Vec<f64>, Vec<f64>),
        (command_time, command): (Vec<f64>, Vec<f64>),
    ) -> Result<Self, Error> {
        let rows = Self {
            used: vec![true; time.len()],
            time,
            output,
            speed: Vec::new(),
            commands: Commands {
                time: command_time,
                value: command,
                unknown: Vec::new(),
                uncertain: Vec::new(),
            },
            offset: true,
            trim: false,
        };
        rows.checked()
    }

    /// The rows, checked.
    ///
    /// # Errors
    ///
    /// If lengths differ, times do not increase, or a number that counts is not finite.
    pub fn checked(self) -> Result<Self, Error> {
        let n = self.time.len();
        refuse_if!(
            n < 2 || self.output.len() != n || self.used.len() != n,
            "{n} times, {} outputs and {} marks of use are given: give two or more rows with one \
             of each",
            self.output.len(),
            self.used.len()
        );
        refuse_if!(
            !self.speed.is_empty() && self.speed.len() != n,
            "{n} times and {} speeds are given: give a speed for each row, or none",
            self.speed.len()
        );
        if let Some(speed) = self.speed.iter().find(|speed| !speed.is_finite()) {
            refuse!("the speed of a row is {speed}: give finite numbers");
        }
        let commands = &self.commands;
        refuse_if!(
            commands.time.is_empty() || commands.time.len() != commands.value.len(),
            "{} times and {} commands are given: give one time for each command",
            commands.time.len(),
            commands.value.len()
        );
        check_times("time", &self.time)?;
        check_times("time of a command", &commands.time)?;
        for (row, (output, used)) in self.output.iter().zip(&self.used).enumerate() {
            refuse_if!(
                *used && !output.is_finite(),
                "the output of row {row} is {output}: give finite numbers, or mark the row as not used"
            );
        }
        if let Some(value) = commands.value.iter().find(|value| !value.is_finite()) {
            refuse!("a command is {value}: give finite numbers");
        }
        let uncertain = commands.uncertain.iter();
        let pairs = uncertain.map(|(start, end, _)| (start, end));
        for (start, end) in pairs.chain(commands.unknown.iter().map(|(start, end)| (start, end))) {
            refuse_if!(
                !(start.is_finite() && end.is_finite() && start < end),
                "commands from {start} to {end} s are unknown: give an end after the start"
            );
        }
        for (_, _, deviation) in &commands.uncertain {
            refuse_if!(
                !(deviation.is_finite() && *deviation >= 0.0),
                "a computed command has an error of {deviation}: give a finite number, zero or \
                 more"
            );
        }
        for pair in commands.uncertain.windows(2) {
            refuse_if!(
                pair[1].1 < pair[0].1,
                "the computed command that ends at {} s follows one that ends at {} s: sort the \
                 commands by their ends",
                pair[1].1,
                pair[0].1
            );
        }
        Ok(self)
    }

    /// Median time between rows, s.
    pub(super) fn row_time(&self) -> f64 {
        let mut between: Vec<f64> = self.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let middle = between.len() / 2;
        if between.is_empty() {
            return 1.0;
        }
        *between.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Largest speed of a row.
    pub(super) fn top_speed(&self) -> f64 {
        largest(self.speed.iter().copied())
    }

    /// Largest change of the command.
    pub(super) fn largest_jump(&self) -> f64 {
        largest(self.commands.value.windows(2).map(|pair| pair[1] - pair[0]))
    }

    /// Time from the first row to the last, s.
    pub(super) fn span(&self) -> f64 {
        match (self.time.first(), self.time.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 1.0,
        }
    }
}

/// The largest size of these, one where all are zero.
fn largest(sizes: impl Iterator<Item = f64>) -> f64 {
    let found = sizes.map(f64::abs).fold(0.0, f64::max);
    if found > 0.0 { found } else { 1.0 }
}

/// An error unless times are finite and increase.
pub(super) fn check_times(what: &str, times: &[f64]) -> Result<(), Error> {
    if let Some(time) = times.iter().find(|time| !time.is_finite()) {
        refuse!("a {what} is {time}: give finite numbers");
    }
    if let Some(pair) = times.windows(2).find(|pair| pair[1] <= pair[0]) {
        refuse!(
            "the {what} {} follows {}: give increasing times",
            pair[1],
            pair[0]
        );
    }
    if let (Some(first), Some(last)) = (times.first(), times.last()) {
        refuse_if!(
            !(last - first).is_finite(),
            "the times run from {first:e} to {last:e} s: give times whose difference is finite"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::tests::recording;
    use super::*;

    /// The refusal of a recording with one thing changed.
    fn refusal(change: impl FnOnce(&mut Rows)) -> String {
        let mut rows = recording(10);
        change(&mut rows);
        rows.checked().unwrap_err().to_string()
    }

    #[test]
    fn what_is_wrong_is_said_with_its_value() {
        assert!(recording(10).checked().is_ok());
        let cases = [
            (
                refusal(|rows| rows.output.truncate(9)),
                "10 times, 9 outputs",
            ),
            (refusal(|rows| rows.used.truncate(9)), "9 marks of use"),
            (
                refusal(|rows| rows.commands.value.truncate(9)),
                "9 commands",
            ),
            (refusal(|rows| rows.time[3] = f64::NAN), "a time is NaN"),
            (
                refusal(|rows| rows.time[3] = 0.0),
                "the time 0 follows 0.13",
            ),
            (
                refusal(|rows| rows.commands.time[9] = f64::INFINITY),
                "a time of a command is inf",
            ),
            (
                refusal(|rows| (rows.time[0], rows.time[9]) = (-1e308, 1e308)),
                "from -1e308 to 1e308 s",
            ),
            (
                refusal(|rows| rows.output[4] = f64::NAN),
                "the output of row 4 is NaN",
            ),
            (
                refusal(|rows| rows.commands.value[0] = -f64::INFINITY),
                "a command is -inf",
            ),
            (
                refusal(|rows| rows.commands.unknown = vec![(2.0, 1.0)]),
                "from 2 to 1 s",
            ),
            (
                refusal(|rows| rows.commands.uncertain = vec![(0.0, f64::NAN, 1.0)]),
                "to NaN s",
            ),
            (
                refusal(|rows| rows.commands.uncertain = vec![(0.0, 1.0, -1.0)]),
                "an error of -1",
            ),
            (
                refusal(|rows| rows.commands.uncertain = vec![(0.0, 2.0, 1.0), (0.0, 1.0, 1.0)]),
                "ends at 1 s follows one that ends at 2 s",
            ),
        ];
        for (found, expected) in cases {
            assert!(found.contains(expected), "{found}");
        }
    }

    #[test]
    fn the_row_time_is_the_median() {
        let mut rows = recording(10);
        rows.time = vec![0.0, 1.0, 2.0, 3.0, 10.0];
        assert_eq!((rows.row_time(), rows.span()), (1.0, 10.0));
    }
}
