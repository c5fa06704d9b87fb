//! Whole arrays: elements are independent, so blocks go to threads as they come and an
//! element's bits depend on nothing but its arguments.

use std::borrow::Cow;
use std::ops::Range;

use num_complex::Complex64;
use rayon::prelude::*;

use super::block;
use crate::{Error, Task};

/// Elements from which on an array is worth more than one thread.
pub const PARALLEL_LENGTH: usize = 10_000;

/// Elements between two looks at the task: about a millisecond of work.
const BLOCK: usize = 2_048;

/// `out[i] = W_k[i](z[i])`; an argument of length 1 serves every element.
///
/// ```
/// use deadtime::{Task, lambertw};
/// use num_complex::Complex64;
///
/// let z = [Complex64::new(1.0, 0.0), Complex64::new(0.0, 0.0)];
/// let mut w = [Complex64::ZERO; 2];
/// lambertw::lambertw_array(&z, &[0], &mut w, &Task::new()).unwrap();
/// assert_eq!(w[0], lambertw::lambertw(z[0], 0));
/// ```
///
/// # Errors
/// `Error::Argument` when the lengths do not fit together, `Error::Interrupted` on request.
pub fn lambertw_array(
    z: &[Complex64],
    k: &[i64],
    out: &mut [Complex64],
    task: &Task,
) -> Result<(), Error> {
    let (z, k) = (
        Argument::new("z", z, out.len())?,
        Argument::new("k", k, out.len())?,
    );
    fill(out, task, |range, out| {
        block::lambertw(&z.within(&range), &k.within(&range), out);
    })
}

/// `out[i] = dde_root(a0[i], a1[i], delay[i], k[i])`; an argument of length 1 serves every
/// element.
///
/// # Errors
/// `Error::Argument` when the lengths do not fit together, `Error::Interrupted` on request.
pub fn dde_root_array(
    a0: &[f64],
    a1: &[f64],
    delay: &[f64],
    k: &[i64],
    out: &mut [Complex64],
    task: &Task,
) -> Result<(), Error> {
    let n = out.len();
    let (a0, a1) = (Argument::new("a0", a0, n)?, Argument::new("a1", a1, n)?);
    let (delay, k) = (Argument::new("delay", delay, n)?, Argument::new("k", k, n)?);
    fill(out, task, |range, out| {
        let (a0, a1) = (a0.within(&range), a1.within(&range));
        block::dde_root(&a0, &a1, &delay.within(&range), &k.within(&range), out);
    })
}

/// One value for all elements, or one for each.
enum Argument<'a, T> {
    Same(T),
    Each(&'a [T]),
}

impl<'a, T: Copy> Argument<'a, T> {
    fn new(name: &str, values: &'a [T], length: usize) -> Result<Self, Error> {
        match values {
            _ if values.len() == length => Ok(Self::Each(values)),
            [same] => Ok(Self::Same(*same)),
            _ => Err(Error::argument(format!(
                "{name} has {} elements and the result {length}: give one element or {length}",
                values.len()
            ))),
        }
    }

    fn within(&self, range: &Range<usize>) -> Cow<'a, [T]> {
        match self {
            Self::Same(value) => Cow::Owned(vec![*value; range.len()]),
            Self::Each(values) => Cow::Borrowed(values.get(range.clone()).unwrap_or_default()),
        }
    }
}

/// `out[range]` by `block(range, &mut out[range])`, blocks shared out among threads.
fn fill<F>(out: &mut [Complex64], task: &Task, block: F) -> Result<(), Error>
where
    F: Fn(Range<usize>, &mut [Complex64]) + Sync,
{
    let work = |(number, out): (usize, &mut [Complex64])| {
        task.check()?;
        let start = number * BLOCK;
        block(start..start + out.len(), out);
        task.advance(out.len() as u64);
        Ok(())
    };
    if out.len() < PARALLEL_LENGTH {
        out.chunks_mut(BLOCK).enumerate().try_for_each(work)
    } else {
        out.par_chunks_mut(BLOCK).enumerate().try_for_each(work)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_and_position_do_not_change_a_bit() {
        let z: Vec<_> = (0..30_000)
            .map(|i| {
                let t = f64::from(i);
                Complex64::from_polar((t * 0.01 - 150.0).exp(), t)
            })
            .collect();
        let k: Vec<_> = (0..30_000).map(|i| i % 7 - 3).collect();
        let mut whole = vec![Complex64::ZERO; z.len()];
        lambertw_array(&z, &k, &mut whole, &Task::new()).unwrap();
        for ((z, k), w) in z.iter().zip(&k).zip(&whole) {
            let alone = crate::lambertw::lambertw(*z, *k);
            assert_eq!(alone.re.to_bits(), w.re.to_bits());
            assert_eq!(alone.im.to_bits(), w.im.to_bits());
        }
        let mut tail = vec![Complex64::ZERO; 77];
        lambertw_array(&z[29_923..], &k[29_923..], &mut tail, &Task::new()).unwrap();
        assert_eq!(tail, whole[29_923..]);
    }

    #[test]
    fn lengths_must_fit_and_a_stop_is_heard() {
        let z = [Complex64::ONE; 3];
        let mut out = [Complex64::ZERO; 3];
        let task = Task::new();
        assert!(matches!(
            lambertw_array(&z, &[0, 1], &mut out, &task),
            Err(Error::Argument(_))
        ));
        task.stop();
        assert_eq!(
            lambertw_array(&z, &[0], &mut out, &task),
            Err(Error::Interrupted)
        );
        assert_eq!(lambertw_array(&[], &[0], &mut [], &Task::new()), Ok(()));
    }
}
