use super::*;

fn term(delay: f64, matrix: &[f64]) -> Term {
    Term {
        delay,
        matrix: matrix.to_vec(),
    }
}

/// x′ + n x′(t − τ) = a x + a1 x(t − τ) + b u(t − τ), y = x.
fn scalar(delay: f64, a: f64, a1: f64, n: f64, b: f64) -> SystemEquations {
    SystemEquations {
        states: 1,
        inputs: 1,
        outputs: 1,
        state: vec![term(0.0, &[a]), term(delay, &[a1])],
        derivative: vec![term(delay, &[n])],
        input: vec![term(delay, &[b])],
        output: vec![term(0.0, &[1.0])],
        ..SystemEquations::default()
    }
}

fn at_rest(n: usize, value: f64) -> Past {
    Past {
        state: vec![value; n],
        history: Signal::constant(&vec![value; n]).unwrap_or_else(|_| unreachable!()),
        slopes: None,
    }
}

fn step_response(equations: SystemEquations, times: &[f64]) -> SystemResponse {
    let n = equations.states;
    let inputs = Signal::step(&[0.0], &[1.0]);
    let found = LinearSystem::new(equations)
        .and_then(|system| system.simulate(at_rest(n, 0.0), &inputs?, times, &Task::new()));
    match found {
        Ok(found) => found,
        Err(error) => unreachable!("{error}"),
    }
}

/// The same by exact polynomials between multiples of the delay: y′ = kp (1 − y) − kv y′, delayed.
fn drone_truth(kp: f64, kv: f64, delay: f64, t: f64) -> f64 {
    // Coefficients of (t − k τ)^j on [k τ, (k + 1) τ].
    let mut pieces: Vec<Vec<f64>> = vec![vec![0.0]];
    let mut end = 0.0;
    let mut k = 0;
    loop {
        let old = pieces.last().cloned().unwrap_or_default();
        let mut slope: Vec<f64> = old.iter().map(|c| -kp * c).collect();
        slope[0] += if k == 0 { 0.0 } else { kp };
        for j in 1..old.len() {
            slope[j - 1] -= kv * j as f64 * old[j];
        }
        let mut new = vec![end];
        new.extend(slope.iter().enumerate().map(|(j, c)| c / (j + 1) as f64));
        let value = |s: f64| new.iter().rev().fold(0.0, |sum, c| sum * s + c);
        let start = delay * k as f64;
        if t <= start + delay {
            return value(t - start);
        }
        end = value(delay);
        pieces.push(new);
        k += 1;
    }
}

#[test]
fn the_loop_is_the_exact_polynomial() {
    let (kp, delay) = (2.0, 0.36);
    let times: Vec<f64> = (1..=50).map(|i| 0.1 * f64::from(i)).collect();
    for kv in [0.0, 0.3] {
        let found = step_response(scalar(delay, 0.0, -kp, kv, kp), &times);
        for (t, y) in times.iter().zip(&found.outputs) {
            let truth = drone_truth(kp, kv, delay, *t);
            assert!((y - truth).abs() < 4e-15, "{kv} {t}: {y} is not {truth}");
        }
    }
}
