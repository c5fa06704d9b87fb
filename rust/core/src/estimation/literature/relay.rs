//! The limit cycle of an integrator under a relay: crossings, switches, and what a lag adds.

use super::held::HeldPath;
use super::zero::zero;

/// How crossings are read.
struct Reading {
    /// Distance from the reference that counts as a crossing, in deviations of the noise: more misses
    /// small cycles.
    clearance: f64,
    /// The same as a share of the range of the output: rounding.
    rounding: f64,
    /// Part of the way to a peak that is taken as straight, also with a lag.
    straight: f64,
}

const READING: Reading = Reading {
    clearance: 4.0,
    rounding: 1e-9,
    straight: 0.6,
};

/// Times at which the output crosses the reference: zeros of lines fitted to the samples around them.
pub fn crossings(time: &[f64], error: &[f64], noise: f64) -> Vec<f64> {
    let (least, most) = error
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| {
            (l.min(*x), m.max(*x))
        });
    let beyond = (READING.clearance * noise).max(READING.rounding * (most - least));
    let mut rough = Vec::new();
    let mut before: Option<usize> = None;
    for (row, value) in error.iter().enumerate() {
        if value.abs() <= beyond {
            continue;
        }
        if let Some(last) = before.filter(|last| error[*last].signum() != value.signum()) {
            // Between the last sample clearly on one side and the first clearly on the other.
            let part = error[last] / (error[last] - value);
            rough.push(time[last] + part * (time[row] - time[last]));
        }
        before = Some(row);
    }
    if rough.len() < 2 {
        return rough;
    }
    let mut halves: Vec<f64> = rough.windows(2).map(|pair| pair[1] - pair[0]).collect();
    halves.sort_by(f64::total_cmp);
    let count = halves.len();
    let median = 0.5 * (halves[(count - 1) / 2] + halves[count / 2]);
    let reach = READING.straight * 0.5 * median;
    rough
        .iter()
        .map(|place| on_a_line(time, error, *place, reach))
        .collect()
}

/// Zero of a line fitted to the samples near a crossing.
fn on_a_line(time: &[f64], error: &[f64], place: f64, reach: f64) -> f64 {
    let rows = time.iter().zip(error).map(|(t, e)| (t - place, *e));
    let near: Vec<(f64, f64)> = rows.filter(|(t, _)| t.abs() <= reach).collect();
    if near.len() < 3 {
        return place;
    }
    let count = near.len() as f64;
    let centre = near.iter().map(|(t, _)| t).sum::<f64>() / count;
    let mean = near.iter().map(|(_, e)| e).sum::<f64>() / count;
    let power: f64 = near.iter().map(|(t, _)| (t - centre).powi(2)).sum();
    let slope = near.iter().map(|(t, e)| (t - centre) * e).sum::<f64>() / power;
    let moved = centre - mean / slope;
    if moved.abs() <= reach {
        place + moved
    } else {
        place
    }
}

/// The switch at a crossing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch {
    /// How often the command switches there; an even number has no effect.
    pub count: usize,
    /// Time of one switch with the same effect.
    pub time: f64,
}

/// The switch at each crossing but the last.
pub fn switches(time: &[f64], signs: &[f64], crossings: &[f64]) -> Vec<Switch> {
    let rows: Vec<f64> = signs
        .windows(2)
        .zip(&time[1.min(time.len())..])
        .filter(|(pair, _)| pair[0] != pair[1])
        .map(|(_, t)| *t)
        .collect();
    let middles: Vec<f64> = crossings
        .windows(2)
        .map(|pair| 0.5 * (pair[0] + pair[1]))
        .collect();
    let (Some(first), Some(middle)) = (crossings.first(), middles.first()) else {
        return Vec::new();
    };
    let mut low = 2.0 * first - middle;
    let mut found = Vec::new();
    for high in middles {
        let own: Vec<f64> = rows
            .iter()
            .copied()
            .filter(|t| *t > low && *t <= high)
            .collect();
        let signed = own
            .iter()
            .enumerate()
            .map(|(i, t)| if i % 2 == 0 { *t } else { -t });
        found.push(Switch {
            count: own.len(),
            time: signed.sum(),
        });
        low = high;
    }
    found
}

/// What the half cycles between crossings, with their switches, say of the delay.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycles {
    /// Number of pairs of half cycles, in which an offset or a drift cancels to first order.
    pub count: usize,
    /// Their mean delay, s.
    pub delay: f64,
    /// Standard error of the mean of cycles that share a crossing with their neighbours: without a hold
    /// the errors of all crossings but the first and the last cancel.
    pub error: f64,
}

/// The delay by each cycle: the middle between two crossings less the switch.
pub fn cycles(crossings: &[f64], switches: &[f64]) -> Cycles {
    let pairs = crossings.windows(2).zip(switches);
    let readings: Vec<f64> = pairs.map(|(c, s)| 0.5 * (c[0] + c[1]) - s).collect();
    let whole = readings[readings.len() % 2..].chunks_exact(2);
    let cycles: Vec<f64> = whole.map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let count = cycles.len() as f64;
    let delay = cycles.iter().sum::<f64>() / count;
    let off: Vec<f64> = cycles.iter().map(|cycle| cycle - delay).collect();
    let power = off.iter().map(|x| x * x).sum::<f64>() / (count - 1.0);
    let neighbours = off.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / (count - 1.0);
    Cycles {
        count: cycles.len(),
        delay,
        error: ((power + 2.0 * neighbours).max(power / count) / count).sqrt(),
    }
}

/// Largest error between each crossing and the next.
pub fn peaks(time: &[f64], error: &[f64], crossings: &[f64]) -> Vec<f64> {
    let row = |crossing: f64| time.partition_point(|t| *t < crossing);
    let pairs = crossings.windows(2);
    pairs
        .map(|pair| {
            let part = error.iter().take(row(pair[1])).skip(row(pair[0]));
            part.fold(0.0, |most: f64, x| most.max(x.abs()))
        })
        .collect()
}

/// Rows of a limit cycle, the path of unit speed that its switches cause there, and the output, both about
/// their means.
#[derive(Debug, Clone, PartialEq)]
pub struct CyclePath {
    /// The rows, from the arrival of the second switch to that of the last.
    pub rows: std::ops::Range<usize>,
    /// The path.
    pub path: Vec<f64>,
    /// The output.
    pub output: Vec<f64>,
    /// Speed of the output along the path.
    pub speed: f64,
}

/// The path of a limit cycle whose switches arrive after a delay, behind a lag; none where no rows are left.
pub fn cycle_path(
    (time, output, reference): (&[f64], &[f64], &[f64]),
    switches: &[f64],
    delay: f64,
    lag: f64,
) -> Option<CyclePath> {
    let (begin, end) = (switches.get(1)? + delay, switches.last()? + delay);
    let rows = time.partition_point(|t| *t < begin)..time.partition_point(|t| *t <= end);
    let first = rows.clone().next()?;
    let sign = if output[first] > reference[first] {
        1.0
    } else {
        -1.0
    };
    let values = (0..switches.len()).map(|i| if i % 2 == 0 { sign } else { -sign });
    let held = HeldPath::new(switches.to_vec(), values.collect());
    let at: Vec<f64> = time[rows.clone()].iter().map(|t| t - delay).collect();
    let about_mean = |part: &[f64]| -> Vec<f64> {
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        part.iter().map(|x| x - mean).collect()
    };
    let path = about_mean(&held.at(&at, lag).value);
    let output = about_mean(&output[rows.clone()]);
    let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    Some(CyclePath {
        speed: product(&path, &output) / product(&path, &path),
        rows,
        path,
        output,
    })
}

/// Increase of a quarter of the period by a lag, for half a period of `half`.
///
/// From the arrival of one switch to that of the next the speed goes from −v to v as
/// 1 − (1 + v) e^(−t/lag), v = tanh(half/(2 lag)), and the output from −p to p. The zero of the output is
/// later than the middle by the returned time.
pub fn delay_by_lag(lag: f64, half: f64) -> f64 {
    if lag == 0.0 {
        return 0.0;
    }
    let v = libm::tanh(0.5 * half / lag);
    let begin = -0.5 * half + v * lag;
    let output = |t: f64| begin + t + (1.0 + v) * lag * libm::expm1(-t / lag);
    zero(output, 0.5 * half, half) - 0.5 * half
}
