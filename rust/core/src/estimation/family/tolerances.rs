//! The tolerances of each stage, with what a larger value trades.

/// Ranges of the numbers of plants and of noise.
pub(super) struct Ranges {
    /// Largest delay as a share of the record where none is given: more rows at the start are left out.
    pub(super) delay_share: f64,
    /// Most of a zero, in spans of either sign: a slower one makes a drift of a plant at rest, and a
    /// plant at rest of one that integrates.
    pub(super) slowest_zero: f64,
    /// Most time constants, in spans of the record: slower ones look like integrators.
    pub(super) slowest: f64,
    /// Shortest lag in rows: faster ones look like delays.
    pub(super) fastest: f64,
    /// The same with a controller in the loop, where a fast plant could be the controller itself.
    pub(super) fastest_in_loop: f64,
    /// Least damping of a pair of poles: less fits single lines of a spectrum.
    pub(super) least_damping: f64,
    /// Largest partial correlation of the autoregression: nearer to 1, drift is noise and no trend.
    pub(super) memory: f64,
    /// Largest of the moving average: nearer to 1, the noise model fits away the offset.
    pub(super) averaging: f64,
}

pub(super) const RANGES: Ranges = Ranges {
    delay_share: 0.3,
    slowest_zero: 0.3,
    slowest: 20.0,
    fastest: 0.05,
    fastest_in_loop: 0.5,
    least_damping: 0.05,
    memory: 0.999,
    averaging: 0.9,
};

/// The search for one minimum.
pub(super) struct Search {
    /// Fall of −2 ln L that is still followed: more ends sooner, further from the minimum.
    pub(super) fall: f64,
    /// Steps of this fall in which a class that is far behind would have to catch up: more follows
    /// longer what is hopeless.
    pub(super) catch_up: f64,
    /// Most steps.
    pub(super) steps: usize,
    /// Step of numerical derivatives: more loses curvature, less digits.
    pub(super) step: f64,
    /// First damping of the steps; more is slower and surer.
    pub(super) damping: f64,
    /// Factor by which damping changes.
    pub(super) change: f64,
    /// Damping at which the search has come to an end.
    pub(super) most_damping: f64,
    /// Residuals are never smaller than this share of the output's deviation, so that outputs
    /// without noise keep an interval: more is wider there.
    pub(super) rounding: f64,
    /// Norm of what is left of a column, as a share, below which it depends on the others.
    pub(super) dependent: f64,
}

pub(super) const SEARCH: Search = Search {
    fall: 1e-3,
    catch_up: 10.0,
    steps: 40,
    step: 1e-5,
    damping: 1e-3,
    change: 5.0,
    most_damping: 1e6,
    rounding: 1e-7,
    dependent: 1e-9,
};

/// Where searches start: more points find more minima and take more time.
pub(super) struct Starts {
    /// Delays on a grid up to the largest.
    pub(super) delays: usize,
    /// Delays beside a grid of time constants.
    pub(super) few_delays: usize,
    /// Time constants on a grid.
    pub(super) lags: usize,
    /// Dampings of pairs of poles.
    pub(super) dampings: [f64; 2],
    /// Starts from the grid that are kept.
    pub(super) gridded: usize,
    /// Starts that are followed, of all.
    pub(super) followed: usize,
    /// The same where minima of the class are known.
    pub(super) refined: usize,
    /// The same under the richest noise, whose numbers may begin at a limit.
    pub(super) coloured: usize,
    /// Minima of a class that are kept.
    pub(super) kept: usize,
    /// All of these for a class without lags, whose delays may be periods of the command apart.
    pub(super) delays_only: usize,
    /// Rows from which searches start: fewer take less time and see less of short responses.
    pub(super) thin: usize,
    /// Two delays closer than so many rows belong to one minimum.
    pub(super) apart: f64,
}

pub(super) const STARTS: Starts = Starts {
    delays: 40,
    few_delays: 10,
    lags: 8,
    dampings: [0.3, 0.9],
    gridded: 2,
    followed: 4,
    refined: 3,
    coloured: 5,
    kept: 2,
    delays_only: 8,
    thin: 400,
    apart: 0.5,
};

/// How classes and noise models are compared.
pub(super) struct Evidence {
    /// BIC within which a class may still be the true one: more widens the hull.
    pub(super) reach: f64,
    /// −2 ln L above the best within which a class has to agree with it: more finds more contradictions.
    pub(super) likely: f64,
    /// −2 ln L within which a held and a straight command are as likely, and the usual one is taken: more
    /// listens less to the record.
    pub(super) tie: f64,
    /// BIC from the best beyond which a class is not followed closely: more costs time.
    pub(super) hopeless: f64,
    /// Standard errors a combination of numbers must stand from nothing to count.
    pub(super) told: f64,
    /// Fall of −2 ln L by a further number from which on its class counts though it is not told.
    pub(super) adds: f64,
    /// Ratio of largest stable gains of two classes that contradict each other.
    pub(super) contradiction: f64,
    /// Ratio of the ends of the largest gain from which on it is not told.
    pub(super) wide: f64,
    /// Their difference in phase at crossover, rad.
    pub(super) turn: f64,
    /// Fewest numbers with which a loop is known: one sine tells two.
    pub(super) enough: usize,
    /// Probability below which residuals are not white.
    pub(super) white: f64,
    /// Residuals that are not white, as a share of what the model moves, above which nothing is claimed: more claims
    /// intervals for plants that are of another kind.
    pub(super) unexplained: f64,
    /// Fall of −2 ln L by a delay below zero that shows a command logged late.
    pub(super) shifted: f64,
}

pub(super) const EVIDENCE: Evidence = Evidence {
    reach: 10.0,
    likely: 6.0,
    tie: 2.0,
    hopeless: 60.0,
    told: 3.0,
    adds: 2.0,
    contradiction: 1.5,
    wide: 4.0,
    turn: 0.5,
    enough: 3,
    white: 1e-3,
    unexplained: 0.3,
    shifted: 10.0,
};

/// How a class is followed along its zero.
pub(super) struct Along {
    /// Half width of the zero, as a share of itself or of the lags, from which on slopes at one point no longer
    /// say what it is: less takes more time.
    pub(super) wide: f64,
    /// First distance, as the same share.
    pub(super) first: f64,
    /// Factor of the next distance: more is faster, and takes the likelihood between them for a parabola.
    pub(super) grow: f64,
    /// Rise of −2 ln L up to which it is followed, times the dispersion: more serves higher levels.
    pub(super) rise: f64,
}

pub(super) const ALONG: Along = Along {
    wide: 0.3,
    first: 0.1,
    grow: 1.6,
    rise: 11.0,
};

/// Rows at rest at the start of a record.
pub(super) struct Rest {
    /// Fewest rows before the first command that can show rest.
    pub(super) rows: usize,
    /// Most standard errors of their slope.
    pub(super) slope: f64,
    /// What the slope may move over these rows, as a share of the output's range: more takes a moving
    /// plant for one at rest.
    pub(super) share: f64,
}

pub(super) const REST: Rest = Rest {
    rows: 8,
    slope: 2.5,
    share: 0.05,
};

/// Blocks of rows whose scores show how far the numbers really scatter.
pub(super) struct Blocks {
    /// Blocks of equal information: more see shorter errors and each sees less.
    pub(super) count: usize,
    /// Share of independent scores in p (m − 1): less is a wider quantile.
    pub(super) freedom: f64,
    /// Probability above which scores scatter as the model says they do: more claims wider errors for
    /// right models, less narrower ones for wrong ones.
    pub(super) chance: f64,
    /// What the model's own scatter then counts for, in multiples of the scores: more is narrower.
    pub(super) prior: f64,
    /// Leverage of a block at which its score is no longer corrected fully.
    pub(super) most_leverage: f64,
    /// Leverage of each block up to which the jackknife holds.
    pub(super) jackknife: f64,
    /// Level at which the scatter between records and within them is compared.
    pub(super) level: f64,
}

pub(super) const BLOCKS: Blocks = Blocks {
    count: 8,
    freedom: 0.6,
    chance: 0.2,
    prior: 2.0,
    most_leverage: 0.98,
    jackknife: 0.5,
    level: 0.95,
};

/// Causes beside the plant.
pub(super) struct Causes {
    /// Classes beside which causes are scored: more see causes that a flexible plant hides, and take longer.
    pub(super) classes: usize,
    /// Share of a column that is its own, below which the plant says the same.
    pub(super) own: f64,
    /// Least of the squares that one column leaves, as a share.
    pub(super) least: f64,
    /// Least factor of a cause whose size is tried: less takes for one what is of another size.
    pub(super) share: f64,
    /// Beginnings of a load that are tried first, and how near to the best one others are tried, in rows.
    pub(super) beginnings: usize,
    pub(super) fine: f64,
    /// The same where the plant is searched beside each.
    pub(super) near: f64,
    /// Rows before a beginning and after it.
    pub(super) margin: usize,
    /// BIC above the best plant without a cause, up to which all classes are fitted with one: more costs time.
    pub(super) hopeful: f64,
    /// Causes that are fitted: more find what the score takes for another, and take longer.
    pub(super) followed: usize,
    /// How often a gain that changes follows the plant that was found with it.
    pub(super) rounds: usize,
    /// Steps to the size of a cause, and the change of it, as a share, that ends them.
    pub(super) refined: usize,
    pub(super) settled: f64,
    /// Factor of a size within which a change of it is taken to first order: more takes what is far from the commands
    /// that were passed.
    pub(super) factor: f64,
    /// BIC by which a cause has to lead: less takes what is not there for one.
    pub(super) adopted: f64,
    /// The same for its name: less gives a drift of the sensor, or one cause, the name of another.
    pub(super) named: f64,
    /// BIC by which it leads where the plant without it is ruled out: more widens intervals.
    pub(super) certain: f64,
    /// The same for a further one, as a share of the lead of the first: less takes for a second cause what
    /// is wrong with the first.
    pub(super) further: f64,
    /// The same as a share of what the error of a class explains: less takes for a cause what remains of that error.
    pub(super) beyond: f64,
    /// Share of the record within which a second load is the first one.
    pub(super) apart: f64,
    /// Fall of −2 ln L by a second load, as a share of that by the first, from which on both are a
    /// disturbance: more takes wind for a load.
    pub(super) again: f64,
    /// Sizes of what sticks that are tried between two of the first.
    pub(super) between: usize,
    /// Standard errors from zero that a cause has to be.
    pub(super) sure: f64,
    /// Numbers of causes beside one plant: more than these are not looked for.
    pub(super) most: usize,
    /// Share of the half of an interval of this level by which a cause moves gain or phase at crossover, so that
    /// it is named: more keeps quiet what is small.
    pub(super) matters: f64,
    pub(super) level: f64,
}

pub(super) const CAUSES: Causes = Causes {
    classes: 3,
    own: 1e-8,
    least: 1e-9,
    share: 0.25,
    beginnings: 48,
    fine: 0.25,
    near: 0.02,
    margin: 8,
    hopeful: 20.0,
    followed: 4,
    rounds: 1,
    refined: 8,
    settled: 0.002,
    factor: 2.0,
    adopted: 6.0,
    named: 20.0,
    certain: 40.0,
    further: 0.04,
    beyond: 1.25,
    apart: 0.1,
    again: 0.3,
    between: 8,
    sure: 3.0,
    most: 3,
    matters: 0.25,
    level: 0.95,
};

/// Times of commands that scatter.
pub(super) struct Jitter {
    /// The least and the largest deviation that is tried, in rows.
    pub(super) least: f64,
    pub(super) most: f64,
    /// Changes of the command that are followed, and the least of them as a share of the largest: more see less
    /// jitter and take longer.
    pub(super) changes: usize,
    pub(super) share: f64,
    /// The length of an impulse, in rows.
    pub(super) width: f64,
    /// How often the noise is found anew, and the least share of the squares that it keeps.
    pub(super) rounds: usize,
    pub(super) left: f64,
}

pub(super) const JITTER: Jitter = Jitter {
    least: 0.01,
    most: 10.0,
    changes: 60,
    share: 0.1,
    width: 0.05,
    rounds: 3,
    left: 0.01,
};

/// Moving means that readings may be.
pub(super) struct Means {
    /// Rows beyond one: the least and the most that are tried, and how many lengths.
    pub(super) least: f64,
    pub(super) most: f64,
    pub(super) lengths: usize,
    /// Variance that was added to a mean, in units of that of a reading, and the share of a length to which it is
    /// found with that: less needs the length to a smaller share.
    pub(super) added: [(f64, f64); 4],
    /// The reach of the next search, in multiples of that share.
    pub(super) again: f64,
    /// BIC by which a mean has to lead, as a share of what the error of a class explains: less takes that error for a
    /// mean.
    pub(super) beyond: f64,
    /// Share of a length within which an odd whole number of rows is tried.
    pub(super) whole: f64,
}

pub(super) const MEANS: Means = Means {
    least: 0.1,
    most: 40.0,
    lengths: 36,
    added: [(3e-2, 0.02), (1e-3, 2e-3), (1e-5, 2e-4), (1e-7, 2e-5)],
    again: 2.0,
    beyond: 1.0,
    whole: 0.1,
};

/// Readings that are no readings.
pub(super) struct Sensors {
    /// Fewest readings that show how a sensor reads.
    pub(super) fewest: usize,
    /// Steps of the sensor that readings usually move by, where equal ones are no readings: less takes a
    /// coarse sensor for one that repeats.
    pub(super) coarse: f64,
    /// Equal readings in multiples of those by chance, and beyond them, from which on all are repeats.
    pub(super) excess: f64,
    pub(super) few: f64,
    /// How many of the smallest moves show whether readings are rounded, fewest of them, and most steps of the
    /// sensor in the least move: more takes moves for whole steps that are none.
    pub(super) moves: usize,
    pub(super) enough: usize,
    pub(super) parts: usize,
    /// Distance from a whole step up to which a move is one, and the share of these from which on readings are
    /// rounded: less of the first, or more of the second, takes equal rounded readings for repeats.
    pub(super) off: f64,
    pub(super) whole: f64,
    /// Runs of equal readings by chance in a record, above which they are repeats.
    pub(super) chance: f64,
    /// Rows, and multiples of the usual repeat, from which on a reading is frozen.
    pub(super) frozen: f64,
    pub(super) longer: f64,
    /// Most rows of a glitch, how many steps before and after it are looked at, how many of these may be
    /// those of other glitches, and multiples of the largest of the rest by which a glitch leaves and comes
    /// back: less takes motion for one.
    pub(super) longest: usize,
    pub(super) around: usize,
    pub(super) others: usize,
    pub(super) far: f64,
}

pub(super) const SENSORS: Sensors = Sensors {
    fewest: 40,
    coarse: 3.0,
    excess: 3.0,
    few: 10.0,
    moves: 24,
    enough: 8,
    parts: 8,
    off: 0.1,
    whole: 0.7,
    chance: 1e-3,
    frozen: 6.0,
    longer: 4.0,
    longest: 5,
    around: 12,
    others: 4,
    far: 4.0,
};

/// The series that stands for a plant's error.
pub(super) struct Flexible {
    /// Its poles that are tried, in multiples of one over the delay and lags: larger ones see errors at higher
    /// frequencies.
    pub(super) poles: [f64; 2],
    /// Half of the angle of a row from which on it stays as it is, below π/2.
    pub(super) highest: f64,
    /// The least and the largest deviation of its factors that is tried.
    pub(super) least: f64,
    pub(super) most: f64,
    /// −2 ln of the marginal likelihood that the largest size may lack: more is wider and leans less on the class.
    pub(super) slack: f64,
    /// Steps that plant and series are searched together, and how often each is shortened.
    pub(super) steps: usize,
    pub(super) shortened: usize,
}

pub(super) const SERIES: Flexible = Flexible {
    poles: [2.0, 5.0],
    highest: 1.5,
    least: 1e-3,
    most: 1.0,
    slack: 1.0,
    steps: 12,
    shortened: 5,
};
