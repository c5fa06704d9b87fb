//! Where the results of a sweep go.

/// Write the first of `values` to the places of `sets`, which increase.
pub(crate) fn put(column: &mut [f64], sets: &[usize], values: &[f64]) {
    let (Some(&first), Some(&last)) = (sets.first(), sets.last()) else {
        return;
    };
    if last - first + 1 == sets.len()
        && let (Some(places), Some(values)) =
            (column.get_mut(first..=last), values.get(..sets.len()))
    {
        places.copy_from_slice(values);
        return;
    }
    for (&set, value) in sets.iter().zip(values) {
        if let Some(place) = column.get_mut(set) {
            *place = *value;
        }
    }
}
