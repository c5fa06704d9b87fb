//! Work on all threads.
//!
//! Parallel iterators are compiled anew for every closure, 20 kB each. The one here is compiled once:
//! closures reach it as trait objects.

use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::Error;
use crate::memory::{collected, reserved};

/// Most groups into which results are divided: a lock for each takes little memory.
const GROUPS: usize = 1 << 16;

/// What a thread does with the items that it takes, by their numbers.
type Worker<'a> = Box<dyn FnMut(usize) -> Result<(), Error> + 'a>;

/// Give the numbers 0, 1, … `count` to workers, of which `start` makes those that are needed.
fn work<'a>(count: usize, start: &(dyn Fn() -> Worker<'a> + Sync)) -> Result<(), Error> {
    (0..count)
        .into_par_iter()
        .try_for_each_init(start, |worker, index| worker(index))
}

/// Do something with every item and its number.
pub(crate) fn each<T: Send>(
    what: &'static str,
    items: impl ExactSizeIterator<Item = T>,
    each: impl Fn(usize, T) -> Result<(), Error> + Sync,
) -> Result<(), Error> {
    let items: Vec<Mutex<Option<T>>> = collected(what, items.map(|item| Mutex::new(Some(item))))?;
    let each = |index: usize| {
        let item = items.get(index).and_then(|item| locked(item).take());
        item.map_or(Ok(()), |item| each(index, item))
    };
    work(items.len(), &|| Box::new(&each))
}

fn locked<T>(place: &Mutex<T>) -> MutexGuard<'_, T> {
    place.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The results of `each` for 0, 1, … `count`, in that order; `start` creates the state of each
/// worker.
///
/// # Errors
/// Those of the work; [`Error::Memory`].
pub(crate) fn results<T, W>(
    what: &'static str,
    count: usize,
    start: impl Fn() -> W + Sync,
    each: impl Fn(&mut W, usize) -> Result<T, Error> + Sync,
) -> Result<Vec<T>, Error>
where
    T: Default + Send,
{
    let mut found = reserved(what, count)?;
    found.resize_with(count, T::default);
    let together = count.div_ceil(GROUPS).max(1);
    let groups = collected(what, found.chunks_mut(together).map(Mutex::new))?;
    work(groups.len(), &|| {
        let (mut own, each, groups) = (start(), &each, &groups);
        Box::new(move |group| {
            let Some(places) = groups.get(group) else {
                return Ok(());
            };
            for (place, index) in locked(places).iter_mut().zip(group * together..) {
                *place = each(&mut own, index)?;
            }
            Ok(())
        })
    })?;
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_and_each_item_is_given_once() {
        let squares = results("the test", 200_000, || (), |(), i| Ok(i * i)).unwrap();
        assert!(
            squares
                .iter()
                .enumerate()
                .all(|(i, square)| *square == i * i)
        );
        let mut counts = vec![0; 100];
        each("the test", counts.chunks_mut(7), |chunk, counts| {
            counts.iter_mut().for_each(|count| *count += chunk);
            Ok(())
        })
        .unwrap();
        assert!(counts.iter().enumerate().all(|(i, count)| *count == i / 7));
    }

    #[test]
    fn errors_of_the_work_and_of_memory_are_returned() {
        let failed = results(
            "the test",
            50,
            || (),
            |(), i| {
                if i == 31 {
                    Err(Error::Interrupted)
                } else {
                    Ok(i)
                }
            },
        );
        assert_eq!(failed, Err(Error::Interrupted));
        assert!(results("the test", usize::MAX, || (), |(), _| Ok(0.0)).is_err());
    }
}
