//! Items in the order of a number that each has, by [`f64::total_cmp`]; equal ones keep their order.
//!
//! The sorts of the standard library are compiled anew for every type and every comparison. Here keys
//! are sorted, which is compiled once, and the items follow them.

/// Lists up to this length are sorted by insertion.
const FEW: usize = 16;

/// The least number first.
pub(crate) fn sort_up<T>(items: &mut [T], number: impl Fn(&T) -> f64) {
    sort(items, |item| key(number(item)));
}

/// The greatest number first.
pub(crate) fn sort_down<T>(items: &mut [T], number: impl Fn(&T) -> f64) {
    sort(items, |item| !key(number(item)));
}

fn sort<T>(items: &mut [T], key: impl Fn(&T) -> u64) {
    if items.len() > FEW {
        let keys = items.iter().map(key).zip(0..).collect();
        follow(items, &mut places(keys));
        return;
    }
    for sorted in 1..items.len() {
        let mut at = sorted;
        while at > 0 && key(&items[at]) < key(&items[at - 1]) {
            items.swap(at, at - 1);
            at -= 1;
        }
    }
}

/// A whole number for each double, in the same order.
fn key(number: f64) -> u64 {
    let bits = number.to_bits();
    if number.is_sign_negative() {
        !bits
    } else {
        bits | 1 << 63
    }
}

/// Where the item of each place comes from.
fn places(mut keys: Vec<(u64, usize)>) -> Vec<usize> {
    keys.sort_unstable();
    keys.into_iter().map(|(_, place)| place).collect()
}

/// Bring to each place the item that was at `from` of that place, cycle by cycle.
fn follow<T>(items: &mut [T], from: &mut [usize]) {
    for start in 0..items.len() {
        let mut at = start;
        loop {
            let next = std::mem::replace(&mut from[at], at);
            if next == start {
                break;
            }
            items.swap(at, next);
            at = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_order_is_that_of_a_stable_sort(
            numbers in proptest::collection::vec(
                prop_oneof![
                    Just(0.0), Just(-0.0), Just(f64::NAN), Just(-f64::NAN), Just(f64::INFINITY),
                    -3.0..3.0_f64, (-3..3_i32).prop_map(f64::from),
                ],
                0..60,
            ),
        ) {
            let items: Vec<(usize, f64)> = numbers.into_iter().enumerate().collect();
            let places = |items: &[(usize, f64)]| items.iter().map(|item| item.0).collect::<Vec<_>>();
            let (mut up, mut down, mut truth) = (items.clone(), items.clone(), items);
            sort_up(&mut up, |item| item.1);
            truth.sort_by(|a, b| a.1.total_cmp(&b.1));
            prop_assert_eq!(places(&up), places(&truth));
            sort_down(&mut down, |item| item.1);
            truth.sort_by_key(|item| item.0);
            truth.sort_by(|a, b| b.1.total_cmp(&a.1));
            prop_assert_eq!(places(&down), places(&truth));
        }
    }
}
