//! Changes of the delay: the second bank is filled from the first, which goes over to it.

use super::cell::Cell;
use super::cells::Cells;

/// Time between changes that is expected before the first row, s. The hazard of the second bank is
/// one a second, so that its weights over this time are the odds for a change.
const RARE: f64 = 3600.0;

/// The delay may change now: states of the main bank go over to every delay.
pub(super) fn inject<const N: usize>(
    main: &Cells<N>,
    changed: &mut Cells<N>,
    hazard: f64,
    white: f64,
) {
    if hazard <= 0.0 {
        return;
    }
    let (count, own) = (main.places.len(), changed.places.len());
    for set in 0..main.cells.len() / count {
        let range = set * count..(set + 1) * count;
        let total: f64 = main.weights[range.clone()].iter().sum();
        if total <= 0.0 {
            continue;
        }
        let parts: Vec<(f64, &Cell<N>)> = main.weights[range.clone()]
            .iter()
            .map(|weight| weight / total)
            .zip(&main.cells[range])
            .filter(|(share, _)| *share > 1e-6)
            .collect();
        let here = Cell::blend(&parts, white);
        let new = hazard * total / own as f64;
        for i in set * own..(set + 1) * own {
            let sum = changed.weights[i] + new;
            let share = new / sum;
            let cell = &mut changed.cells[i];
            *cell = if share > 1.0 - 1e-9 {
                here.clone()
            } else {
                Cell::blend(&[(1.0 - share, cell), (share, &here)], white)
            };
            changed.weights[i] = sum;
        }
    }
}

/// Go over to what the second bank has found, as far as changes are more probable than not.
pub(super) fn change<const N: usize>(
    main: &mut Cells<N>,
    changed: &mut Cells<N>,
    delays: &[f64],
    sum: f64,
    white: f64,
) {
    let (count, own) = (main.places.len(), changed.places.len());
    let mut added = vec![0.0; main.cells.len()];
    let mut nearest = vec![0; main.cells.len()];
    for set in 0..main.cells.len() / count {
        for (delay, late) in delays.iter().enumerate() {
            let places = &changed.places;
            let after = places.partition_point(|place| *place < delay).min(own - 1);
            let before = match places[after] > delay {
                true => after.saturating_sub(1),
                false => after,
            };
            let (low, high) = (delays[places[before]], delays[places[after]]);
            let share = if high > low {
                ((late - low) / (high - low)).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let weight = |place: usize| changed.weights[set * own + place];
            let place = set * count + delay;
            added[place] = (1.0 - share) * weight(before) + share * weight(after);
            nearest[place] = set * own + if share < 0.5 { before } else { after };
        }
    }
    let odds = sum / (RARE * added.iter().sum::<f64>());
    let mut total = 0.0;
    for (place, (added, nearest)) in added.iter().zip(nearest).enumerate() {
        let (weight, added) = (main.weights[place], added * odds);
        let whole = weight + added;
        if added > 1e-9 * whole {
            let parts = [
                (weight / whole, &main.cells[place]),
                (added / whole, &changed.cells[nearest]),
            ];
            main.cells[place] = Cell::blend(&parts, white);
        }
        main.weights[place] = whole;
        total += whole;
    }
    for weight in &mut main.weights {
        *weight /= total;
    }
    changed.weights.fill(0.0);
}
