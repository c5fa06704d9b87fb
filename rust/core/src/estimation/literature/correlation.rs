//! Correlations of commands and responses.

use num_complex::Complex64;

use super::super::columns::Columns;
use crate::linear_algebra::vectors::dot;

/// Filters that whiten a command, and tests against chance.
struct Orders {
    /// Longest filter, in samples: more whitens narrow spectra, and fits noise.
    longest: usize,
    /// The same as a share of the record.
    share: usize,
    /// Frequencies over which spectra are averaged, as a share of all: more has less noise and less
    /// resolution.
    smoothed: f64,
    /// Fewest of them.
    fewest: usize,
    /// Least weight of a line, as a share of the largest.
    floor: f64,
    /// Power that counts as nothing, as a share.
    nothing: f64,
    /// Part of the record over which memory is summed.
    memory: usize,
    /// Past samples in the test for feedback.
    past: usize,
    /// Column that depends on others, as a share of it.
    dependent: f64,
    /// Rounding of a sum of squares, as a share.
    rounding: f64,
}

const ORDERS: Orders = Orders {
    longest: 12,
    share: 8,
    smoothed: 0.05,
    fewest: 3,
    floor: 1e-12,
    nothing: 1e-24,
    memory: 4,
    past: 2,
    dependent: 1e-10,
    rounding: 1e-20,
};

/// The whitening filter 1 − a₁ q − a₂ q² … of u, its order by Akaike's criterion.
fn whitener(u: &[f64]) -> Vec<f64> {
    let most = ORDERS.longest.min(u.len() / ORDERS.share);
    let target = &u[most..];
    let mut columns = Columns::new(target, ORDERS.dependent);
    let floor = ORDERS.nothing * dot(u, u);
    let criterion = |power: f64, order: usize| {
        target.len() as f64 * libm::log(power.max(floor)) + 2.0 * order as f64
    };
    let (mut best, mut order) = (criterion(columns.power(), 0), 0);
    for lag in 1..=most {
        if !columns.take(u[most - lag..u.len() - lag].to_vec()) {
            break;
        }
        let found = criterion(columns.power(), lag);
        if found < best {
            (best, order) = (found, lag);
        }
    }
    let weights = columns.weights(order);
    std::iter::once(1.0)
        .chain(weights.iter().map(|w| -w))
        .collect()
}

/// How the cross spectrum of command and response is weighted (Knapp & Carter 1976).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// By 1.
    None,
    /// By 1/sqrt(S_uu S_rr), spectra averaged over neighbouring frequencies.
    Scot,
    /// By 1/|S_ur|.
    Phat,
    /// Both signals pass the filter that whitens the command.
    Prewhitened,
}

/// The shift of the largest correlation from `least` to `longest`, and the peak beside it between samples.
///
/// A broad peak is found by a parabola; that of whitened signals by the share of the two largest values,
/// which a delay of (d + f) samples under a hold leaves at 1 − f and f.
pub fn peak(
    u: &[f64],
    r: &[f64],
    weighting: Weighting,
    (least, longest): (usize, usize),
) -> (usize, f64) {
    let found = correlogram(u, r, weighting, longest + 1);
    let at = |shift: usize| found.get(shift).copied().unwrap_or(0.0);
    let places = least..=longest;
    let place = places
        .min_by(|one, other| at(*other + 1).total_cmp(&at(*one + 1)))
        .unwrap_or(least);
    let (before, top, after) = (at(place), at(place + 1), at(place + 2));
    let between = if matches!(weighting, Weighting::None | Weighting::Scot) {
        let bend = before - 2.0 * top + after;
        let vertex = 0.5 * (before - after) / bend;
        if bend < 0.0 {
            vertex.clamp(-1.0, 1.0)
        } else {
            0.0
        }
    } else {
        let (beside, sign) = if after > before {
            (after, 1.0)
        } else {
            (before, -1.0)
        };
        sign * beside.max(0.0) / (top + beside.max(0.0))
    };
    (place, between)
}

/// The generalised cross-correlation at shifts from −1 to `longest` samples.
fn correlogram(u: &[f64], r: &[f64], weighting: Weighting, longest: usize) -> Vec<f64> {
    if matches!(weighting, Weighting::None | Weighting::Prewhitened) {
        let (mut u, mut r) = (u.to_vec(), r.to_vec());
        if weighting == Weighting::Prewhitened {
            let filter = whitener(&u);
            (u, r) = (filtered(&u, &filter), filtered(&r, &filter));
        }
        // One sample more before the response: shifts begin at −1.
        r.insert(0, 0.0);
        return correlation(&r, &u, longest + 2);
    }
    let length = 2 * u.len(); // no shift wraps around
    let padded = |x: &[f64]| {
        let mut x = x.to_vec();
        x.resize(length, 0.0);
        spectrum(&x)
    };
    let (of_u, of_r) = (padded(u), padded(r));
    let cross: Vec<Complex64> = of_r.iter().zip(&of_u).map(|(r, u)| r * u.conj()).collect();
    let half = u.len() + 1;
    let scale: Vec<f64> = if weighting == Weighting::Phat {
        cross[..half].iter().map(|x| x.norm()).collect()
    } else {
        let width = ORDERS.fewest.max((ORDERS.smoothed * half as f64) as usize);
        let smooth = |x: &[Complex64]| moving_mean(&x[..half], width);
        let pairs = smooth(&of_u).into_iter().zip(smooth(&of_r));
        pairs.map(|(u, r)| (u * r).sqrt()).collect()
    };
    let floor = ORDERS.floor * scale.iter().copied().fold(0.0, f64::max);
    let whole = (0..length).map(|k| {
        let at = k.min(length - k);
        (cross[k] / scale[at].max(floor)).conj()
    });
    let mut whole: Vec<Complex64> = whole.collect();
    whole = complex_spectrum(&whole);
    let shifted = (0..longest + 2).map(|k| (k + length - 1) % length);
    shifted.map(|k| whole[k].re / length as f64).collect()
}

/// Means of squares over so many neighbours, zero beyond the ends, as `numpy.convolve` takes them.
fn moving_mean(x: &[Complex64], width: usize) -> Vec<f64> {
    let behind = (width - 1) / 2;
    let ahead = width - 1 - behind;
    let one = |i: usize| {
        let near = &x[i.saturating_sub(ahead)..(i + behind + 1).min(x.len())];
        near.iter().map(|x| x.norm_sqr()).sum::<f64>() / width as f64
    };
    (0..x.len()).map(one).collect()
}

/// A signal behind a filter, from rest.
fn filtered(x: &[f64], filter: &[f64]) -> Vec<f64> {
    let one = |k: usize| {
        let taps = filter.iter().take(k + 1).enumerate();
        taps.map(|(lag, tap)| tap * x[k - lag]).sum()
    };
    (0..x.len()).map(one).collect()
}

/// Correlation coefficient of a response and a command `shift` samples earlier, and its variance for
/// independent signals, times the samples: Σ_m ρ_u(m) ρ_e(m) (Bartlett 1935).
pub fn coefficient(command: &[f64], response: &[f64], shift: usize) -> (f64, f64) {
    let size = command.len();
    let (u, r) = (
        &command[..size - shift.min(size)],
        &response[shift.min(size)..],
    );
    let (uu, rr, ur) = (dot(u, u), dot(r, r), dot(u, r));
    let product = (uu * rr).sqrt();
    let found = ur / if product > 0.0 { product } else { 1.0 };
    let slope = ur / if uu > 0.0 { uu } else { 1.0 };
    let left: Vec<f64> = u.iter().zip(r).map(|(u, r)| r - u * slope).collect();
    let lags = u.len() / ORDERS.memory;
    let (of_u, of_left) = (correlation(u, u, lags), correlation(&left, &left, lags));
    let scale = |x: &[f64]| x.first().copied().filter(|x| *x > 0.0).unwrap_or(1.0);
    let (by_u, by_left) = (scale(&of_u), scale(&of_left));
    let pairs = of_u.iter().zip(&of_left).enumerate().skip(1);
    let memory: f64 = pairs
        .map(|(m, (a, b))| (1.0 - m as f64 / u.len() as f64) * a / by_u * b / by_left)
        .sum();
    (found, 1.0 + 2.0 * memory)
}

/// Statistic of a Granger (1969) F test, with its degrees of freedom: whether the output improves the
/// prediction of the command by the reference and past commands; none where the test says nothing.
pub fn feedback(command: &[f64], reference: &[f64], output: &[f64]) -> Option<(f64, usize, usize)> {
    let past = ORDERS.past;
    let rows = command.len().saturating_sub(past);
    let back = |values: &[f64], lag: usize| values[past - lag..past - lag + rows].to_vec();
    let mut columns = Columns::new(command.get(past..)?, ORDERS.dependent);
    columns.take(vec![1.0; rows]);
    for lag in 1..=past {
        columns.take(back(command, lag));
    }
    for lag in 0..=past {
        columns.take(back(reference, lag));
    }
    let (plain, rank) = (columns.power(), columns.rank());
    for lag in 0..=past {
        columns.take(back(output, lag));
    }
    let mean = command.iter().sum::<f64>() / command.len() as f64;
    let floor = ORDERS.rounding * command.iter().map(|u| (u - mean).powi(2)).sum::<f64>();
    let (more, freedom) = (columns.rank() - rank, rows.saturating_sub(columns.rank()));
    if more < 1 || freedom < 1 || plain <= floor {
        return None;
    }
    let full = columns.power();
    let ratio = (plain - full) / more as f64 / (full.max(floor) / freedom as f64);
    Some((ratio.max(0.0), more, freedom))
}

/// Σ_k target_k command_{k−lag} for each of the first `lags` delays.
pub(super) fn correlation(target: &[f64], command: &[f64], lags: usize) -> Vec<f64> {
    let length = (target.len() + command.len())
        .max(lags + 1)
        .next_power_of_two();
    let spectrum = |values: &[f64]| {
        let mut x: Vec<Complex64> = values.iter().map(|x| Complex64::from(*x)).collect();
        x.resize(length, Complex64::ZERO);
        transform(&mut x);
        x
    };
    let (y, u) = (spectrum(target), spectrum(command));
    // The inverse transform of conj(x) is the conjugate of the transform of x over the length.
    let mut cross: Vec<Complex64> = y
        .iter()
        .zip(&u)
        .map(|(y, u)| (y * u.conj()).conj())
        .collect();
    transform(&mut cross);
    cross
        .iter()
        .take(lags)
        .map(|x| x.re / length as f64)
        .collect()
}

/// The discrete Fourier transform of any number of values, as a convolution (Bluestein 1970).
pub(super) fn spectrum(values: &[f64]) -> Vec<Complex64> {
    let values: Vec<Complex64> = values.iter().map(|x| Complex64::from(*x)).collect();
    complex_spectrum(&values)
}

fn complex_spectrum(values: &[Complex64]) -> Vec<Complex64> {
    let n = values.len();
    let length = (2 * n).next_power_of_two();
    let chirp = |k: usize| {
        let angle = std::f64::consts::PI * ((k * k) % (2 * n)) as f64 / n as f64;
        Complex64::new(libm::cos(angle), libm::sin(angle))
    };
    let mut signal = vec![Complex64::ZERO; length];
    let mut kernel = vec![Complex64::ZERO; length];
    for (k, x) in values.iter().enumerate() {
        signal[k] = x * chirp(k).conj();
        kernel[k] = chirp(k);
        if k > 0 {
            kernel[length - k] = chirp(k);
        }
    }
    transform(&mut signal);
    transform(&mut kernel);
    let products = signal.iter().zip(&kernel);
    let mut product: Vec<Complex64> = products.map(|(x, y)| (x * y).conj()).collect();
    transform(&mut product);
    let turned = |k: usize| product[k].conj() / length as f64 * chirp(k).conj();
    (0..n).map(turned).collect()
}

/// The discrete Fourier transform of a power of two of values (Cooley & Tukey 1965).
fn transform(x: &mut [Complex64]) {
    let n = x.len();
    let mut j = 0;
    for i in 1..n {
        let mut bit = n >> 1;
        while j & bit != 0 {
            j ^= bit;
            bit >>= 1;
        }
        j |= bit;
        if i < j {
            x.swap(i, j);
        }
    }
    let turn = |k: usize| {
        let angle = -2.0 * std::f64::consts::PI * k as f64 / n as f64;
        Complex64::new(libm::cos(angle), libm::sin(angle))
    };
    let turns: Vec<Complex64> = (0..n / 2).map(turn).collect();
    let mut half = 1;
    while half < n {
        let stride = n / (2 * half);
        for block in x.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let turned = *b * turns[k * stride];
                (*a, *b) = (*a + turned, *a - turned);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correlation_is_that_of_its_sums() {
        let target: Vec<f64> = (0..23).map(|i| libm::sin(1.7 * f64::from(i))).collect();
        let command: Vec<f64> = (0..22).map(|i| libm::cos(0.9 * f64::from(i * i))).collect();
        for (lag, found) in correlation(&target, &command, 12).iter().enumerate() {
            assert!(
                (found
                    - dot(
                        &command[..22.min(23 - lag)],
                        &target[lag..][..22.min(23 - lag)]
                    ))
                .abs()
                    < 1e-12
            );
        }
    }

    /// Numbers between −0.5 and 0.5 (Knuth's linear congruential generator).
    fn random(count: usize, seed: u32) -> Vec<f64> {
        let mut state = seed;
        let next = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        (0..count).map(next).collect()
    }

    #[test]
    fn the_order_of_a_whitener_is_that_of_akaike() {
        // For white noise his criterion takes no coefficient with probability exp(−Σ P(X_i > 2 i)/i) =
        // 0.712, X_i chi-square with i degrees of freedom (Shibata 1976); 200 draws have a deviation of
        // 0.032.
        let none = |seed: &u32| whitener(&random(400, 7919 * seed + 1)).len() == 1;
        let share = (0..200).filter(none).count() as f64 / 200.0;
        assert!((share - 0.712).abs() < 0.096, "{share}");
    }

    #[test]
    fn a_peak_between_samples_is_found_by_every_weighting() {
        let u = random(4000, 5);
        let at = |k: usize, lag: usize| k.checked_sub(lag).map_or(0.0, |k| u[k]);
        let r: Vec<f64> = (0..4000).map(|k| 0.7 * at(k, 4) + 0.3 * at(k, 5)).collect();
        let (place, between) = peak(&u, &r, Weighting::Prewhitened, (0, 300));
        assert!((place as f64 + between - 4.3).abs() < 0.1);
        for weighting in [Weighting::None, Weighting::Scot, Weighting::Phat] {
            assert_eq!(peak(&u, &r, weighting, (0, 300)).0, 4);
        }
    }

    #[test]
    fn a_first_order_signal_is_whitened_by_its_pole() {
        let mut x = 0.0;
        let signal: Vec<f64> = random(4000, 1)
            .iter()
            .map(|e| {
                x = 0.8 * x + e;
                x
            })
            .collect();
        assert!((whitener(&signal)[1] + 0.8).abs() < 0.05);
    }
}
