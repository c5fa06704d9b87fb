//! What the fields of frames are.

use super::encoding::Encoding;
use crate::error::Fault;

/// Most fields that a frame may have; Betaflight and INAV write up to about 150.
pub const MAX_FIELDS: usize = 512;

/// What is added to a value that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Predictor {
    Zero,
    Previous,
    /// As far from the frame before as that is from the one before it.
    StraightLine,
    /// The mean of the two frames before.
    Average,
    LeastThrottle,
    /// The first motor of this frame.
    FirstMotor,
    /// One more than before, and what was left out on purpose.
    Increment,
    /// A coordinate of home: the first or the second.
    Home(usize),
    FifteenHundred,
    Voltage,
    /// The time of the last main frame.
    MainTime,
    LeastMotor,
}

impl Predictor {
    const fn of(code: u8) -> Option<Self> {
        Some(match code {
            0 => Self::Zero,
            1 => Self::Previous,
            2 => Self::StraightLine,
            3 => Self::Average,
            4 => Self::LeastThrottle,
            5 => Self::FirstMotor,
            6 => Self::Increment,
            7 => Self::Home(0),
            8 => Self::FifteenHundred,
            9 => Self::Voltage,
            10 => Self::MainTime,
            11 => Self::LeastMotor,
            _ => return None,
        })
    }
}

/// The fields of one kind of frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Fields {
    /// Encodings, with the number of fields that each reads together.
    pub(crate) groups: Vec<(Encoding, usize)>,
    pub(crate) predictors: Vec<Predictor>,
}

impl Fields {
    /// Fields by the codes of their encodings and predictors in the head of the log.
    ///
    /// # Errors
    /// A code that is unknown, a group of three or four fields that is not complete, lists of
    /// different lengths, or more than [`MAX_FIELDS`].
    pub fn new(encodings: &[u8], predictors: &[u8]) -> Result<Self, Fault> {
        let (length, wanted) = (predictors.len(), encodings.len());
        if length != wanted {
            return Err(Fault::Length { length, wanted });
        }
        if length > MAX_FIELDS {
            let limit = MAX_FIELDS;
            return Err(Fault::Long { length, limit });
        }
        let codes = encodings.iter().map(|&code| {
            let encoding = Encoding::of(code);
            encoding.ok_or(Fault::Code {
                name: "encoding",
                code,
            })
        });
        let encodings = codes.collect::<Result<Vec<_>, _>>()?;
        let codes = predictors.iter().map(|&code| {
            let predictor = Predictor::of(code);
            predictor.ok_or(Fault::Code {
                name: "predictor",
                code,
            })
        });
        let mut predictors = codes.collect::<Result<Vec<_>, _>>()?;
        // Both coordinates of home have the same code, one after the other.
        let mut before = None;
        for predictor in &mut predictors {
            if *predictor == Predictor::Home(0) && before == Some(Predictor::Home(0)) {
                *predictor = Predictor::Home(1);
            }
            before = Some(*predictor);
        }
        let mut groups = Vec::new();
        let mut left = encodings.as_slice();
        while let Some(&encoding) = left.first() {
            let run = left.iter().take_while(|&&next| next == encoding).count();
            let group = encoding.group(run);
            if group > run {
                return Err(Fault::Group { run, group });
            }
            groups.push((encoding, group));
            left = left.get(group..).unwrap_or_default();
        }
        Ok(Self { groups, predictors })
    }

    /// The number of fields.
    #[must_use]
    pub fn count(&self) -> usize {
        self.predictors.len()
    }
}

/// What the head of a log says of its frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// The fields of `I` frames.
    pub intra: Fields,
    /// The same fields in `P` frames, where there are such frames.
    pub inter: Option<Fields>,
    /// The fields of `S` frames.
    pub slow: Option<Fields>,
    /// The fields of `G` frames.
    pub gps: Option<Fields>,
    /// The fields of `H` frames.
    pub home: Option<Fields>,
    /// Which of the fields is the number of the loop's iteration.
    pub iteration: usize,
    /// Which of the fields is the time, µs.
    pub time: usize,
    /// Which of the fields is the first motor.
    pub first_motor: Option<usize>,
    /// `minthrottle` of the head.
    pub least_throttle: i32,
    /// The first number of `motorOutput` of the head.
    pub least_motor: i32,
    /// `vbatref` of the head.
    pub voltage: i32,
    /// Iterations from one `I` frame to the next.
    pub interval: u32,
    /// Of `logged.1` iterations, `logged.0` are written.
    pub logged: (u32, u32),
}

impl Layout {
    /// Whether the firmware writes a frame in an iteration.
    fn writes(&self, iteration: u32) -> bool {
        let (some, all) = self.logged;
        let at = (iteration % self.interval.max(1)).saturating_add(some.max(1) - 1);
        at % all.max(1) < some.max(1)
    }

    /// Iterations after `iteration` that are left out on purpose.
    pub(crate) fn left_out(&self, iteration: u32) -> u32 {
        // More than the firmware can be told to leave out.
        const MOST: u32 = 1024;
        let next = (0..MOST).find(|&k| self.writes(iteration.wrapping_add(k).wrapping_add(1)));
        next.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_in_groups() {
        let fields = Fields::new(&[7, 7, 7, 6, 6, 0, 9, 6], &[0; 8]).unwrap();
        let sizes: Vec<usize> = fields.groups.iter().map(|group| group.1).collect();
        assert_eq!(sizes, [3, 2, 1, 1, 1]);
        let nine = Fields::new(&[6; 9], &[0; 9]).unwrap();
        assert_eq!(
            nine.groups,
            [(Encoding::Tagged8, 8), (Encoding::Tagged8, 1)]
        );
        let home = Fields::new(&[0; 3], &[7; 3]).unwrap();
        let places = [0, 1, 0].map(Predictor::Home);
        assert_eq!(home.predictors, places);
    }

    #[test]
    fn fields_that_cannot_be() {
        let code = |name, code| Fault::Code { name, code };
        assert_eq!(Fields::new(&[2], &[0]), Err(code("encoding", 2)));
        assert_eq!(Fields::new(&[0], &[12]), Err(code("predictor", 12)));
        let (run, group) = (2, 4);
        assert_eq!(
            Fields::new(&[8, 8], &[0, 0]),
            Err(Fault::Group { run, group })
        );
        assert!(Fields::new(&[0], &[]).is_err());
        assert!(Fields::new(&[0; 513], &[0; 513]).is_err());
    }
}
