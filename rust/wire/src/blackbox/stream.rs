//! The frames of a log one after the other, with damaged ones left out.

use std::ops::ControlFlow;

use super::encoding::Bytes;
use super::fields::{Fields, Layout, Predictor};

/// What a frame tells of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Main,
    Slow,
    Gps,
}

/// How the frames came to an end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Tally {
    /// Whether the log has the mark of its end.
    pub(crate) ended: bool,
    /// Places at which the log is damaged.
    pub(crate) damaged: u32,
    /// Frames that are whole but tell nothing, because what they build on is lost.
    pub(crate) unusable: u32,
}

/// Longest step of the clock between two main frames, µs; a longer one is a sign of damage, unless
/// the next frame agrees with it.
const LONGEST_STEP: i32 = 10_000_000;
/// The most iterations between two main frames.
const MOST_ITERATIONS: i32 = 5_000;

/// Whether a main frame can follow another: (iteration, time) of both.
fn follows(before: (u32, u32), now: (u32, u32)) -> bool {
    let iterations = now.0.wrapping_sub(before.0) as i32;
    let step = now.1.wrapping_sub(before.1) as i32;
    (0..=MOST_ITERATIONS).contains(&iterations) && (0..=LONGEST_STEP).contains(&step)
}

/// The reader, and what it remembers of the frames so far.
pub(crate) struct Stream<'a> {
    layout: &'a Layout,
    bytes: Bytes<'a>,
    /// The values that are being read.
    values: Vec<i32>,
    /// The last main frame, and the one before it.
    before: Vec<i32>,
    earlier: Vec<i32>,
    /// Whether the next `P` frame can build on these.
    valid: bool,
    /// Iteration and time of the last main frame, and of one that did not seem to follow it.
    last: Option<(u32, u32)>,
    suspect: Option<(u32, u32)>,
    home: Option<[i32; 2]>,
    tally: Tally,
}

impl<'a> Stream<'a> {
    pub(crate) fn new(data: &'a [u8], layout: &'a Layout) -> Self {
        let count = layout.intra.count();
        Self {
            layout,
            bytes: Bytes { data, at: 0 },
            values: Vec::new(),
            before: vec![0; count],
            earlier: vec![0; count],
            valid: false,
            last: None,
            suspect: None,
            home: None,
            tally: Tally::default(),
        }
    }

    /// Shows every frame; ends early when `show` breaks off.
    pub(crate) fn run(mut self, mut show: impl FnMut(Kind, &[i32]) -> ControlFlow<()>) -> Tally {
        // Bytes between two frames that can be read are one damaged place.
        let mut in_damage = false;
        loop {
            let start = self.bytes.at;
            let Some(letter) = self.bytes.byte() else {
                return self.tally;
            };
            if self.frame(letter).is_some() && self.is_followed() {
                in_damage = false;
                if self.tally.ended || self.accept(letter, &mut show).is_break() {
                    return self.tally;
                }
            } else {
                self.bytes.at = start + 1;
                self.valid = false;
                self.tally.damaged += u32::from(!in_damage);
                in_damage = true;
            }
        }
    }

    fn fields(&self, letter: u8) -> Option<&'a Fields> {
        match letter {
            b'I' => Some(&self.layout.intra),
            b'P' => self.layout.inter.as_ref(),
            b'S' => self.layout.slow.as_ref(),
            b'G' => self.layout.gps.as_ref(),
            b'H' => self.layout.home.as_ref(),
            _ => None,
        }
    }

    /// Whether a frame or the end follows, as it has to after a whole frame.
    fn is_followed(&self) -> bool {
        let next = self.bytes.data.get(self.bytes.at);
        self.tally.ended
            || next.is_none_or(|&letter| letter == b'E' || self.fields(letter).is_some())
    }

    /// Reads the frame that starts with `letter`.
    fn frame(&mut self, letter: u8) -> Option<()> {
        if letter == b'E' {
            return self.event();
        }
        let fields = self.fields(letter)?;
        self.values.clear();
        self.values.resize(fields.count(), 0);
        let mut rest = self.values.as_mut_slice();
        for &(encoding, count) in &fields.groups {
            let (group, after) = rest.split_at_mut_checked(count)?;
            self.bytes.group(encoding, group)?;
            rest = after;
        }
        self.predict(fields, letter);
        Some(())
    }

    /// Adds the predictions to the differences.
    fn predict(&mut self, fields: &Fields, letter: u8) {
        let layout = self.layout;
        let delta = letter == b'P';
        for (k, predictor) in fields.predictors.iter().enumerate() {
            let of = |frame: &[i32]| {
                let value = frame.get(k).copied().filter(|_| delta);
                value.unwrap_or(0)
            };
            let prediction = match predictor {
                Predictor::Zero => continue,
                Predictor::Previous => of(&self.before),
                Predictor::StraightLine => of(&self.before)
                    .wrapping_mul(2)
                    .wrapping_sub(of(&self.earlier)),
                // Towards zero, as the firmware divides.
                Predictor::Average => of(&self.before).wrapping_add(of(&self.earlier)) / 2,
                Predictor::LeastThrottle => layout.least_throttle,
                Predictor::FirstMotor => {
                    let first = layout.first_motor.and_then(|motor| self.values.get(motor));
                    first.copied().unwrap_or(0)
                }
                Predictor::Increment if delta => {
                    let last = of(&self.before);
                    let left_out = layout.left_out(last as u32) as i32;
                    last.wrapping_add(1).wrapping_add(left_out)
                }
                Predictor::Increment => 0,
                Predictor::Home(axis) => self
                    .home
                    .and_then(|home| home.get(*axis).copied())
                    .unwrap_or(0),
                Predictor::FifteenHundred => 1500,
                Predictor::Voltage => layout.voltage,
                Predictor::MainTime => self.last.map_or(0, |(_, time)| time as i32),
                Predictor::LeastMotor => layout.least_motor,
            };
            if let Some(value) = self.values.get_mut(k) {
                *value = value.wrapping_add(prediction);
            }
        }
    }

    /// Takes a frame that was read whole.
    fn accept(
        &mut self,
        letter: u8,
        show: &mut impl FnMut(Kind, &[i32]) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        match letter {
            b'I' | b'P' => {
                if !self.accept_main(letter == b'I') {
                    self.tally.unusable += 1;
                    return ControlFlow::Continue(());
                }
                show(Kind::Main, &self.before)
            }
            b'S' => show(Kind::Slow, &self.values),
            b'H' => {
                if let [first, second, ..] = *self.values.as_slice() {
                    self.home = Some([first, second]);
                }
                ControlFlow::Continue(())
            }
            b'G' if self.home.is_some() && self.last.is_some() => show(Kind::Gps, &self.values),
            b'G' => {
                self.tally.unusable += 1;
                ControlFlow::Continue(())
            }
            _ => ControlFlow::Continue(()),
        }
    }

    /// Whether a main frame can be used; it is the last one then.
    fn accept_main(&mut self, intra: bool) -> bool {
        if !intra && !self.valid {
            return false;
        }
        let value = |k: usize| self.values.get(k).map_or(0, |&value| value as u32);
        let now = (value(self.layout.iteration), value(self.layout.time));
        let agrees = |before: Option<(u32, u32)>| before.is_none_or(|before| follows(before, now));
        let follows = agrees(self.last) || (self.suspect.is_some() && agrees(self.suspect));
        if !follows {
            self.suspect = Some(now);
            self.valid = false;
            return false;
        }
        (self.last, self.suspect, self.valid) = (Some(now), None, true);
        std::mem::swap(&mut self.earlier, &mut self.before);
        self.before.copy_from_slice(&self.values);
        if intra {
            self.earlier.copy_from_slice(&self.values);
        }
        true
    }

    /// Reads an event.
    fn event(&mut self) -> Option<()> {
        const END: &[u8] = b"End of log";
        match self.bytes.byte()? {
            // The beep of arming, why it was disarmed, a fault of the sensors.
            0 | 15 | 40 => {
                self.bytes.unsigned()?;
            }
            // A setting changed in flight, to a real number or to an integer.
            13 => {
                if self.bytes.byte()? < 0x80 {
                    self.bytes.signed()?;
                } else {
                    for _ in 0..4 {
                        self.bytes.byte()?;
                    }
                }
            }
            // The log goes on after a pause.
            14 => {
                let now = (self.bytes.unsigned()?, self.bytes.unsigned()?);
                if self.is_followed() {
                    self.last = Some(now);
                }
            }
            // Another flight mode.
            30 => {
                self.bytes.unsigned()?;
                self.bytes.unsigned()?;
            }
            255 => {
                let rest = self.bytes.data.get(self.bytes.at..)?;
                self.tally.ended = rest.starts_with(END);
                return self.tally.ended.then_some(());
            }
            _ => return None,
        }
        Some(())
    }
}
