//! Maps over two numbers of a loop.

use deadtime::loops::{ControlLoop, HeldPlane, Place};
use deadtime::stability::{Axis, Boundaries, Chart, Family, Question, boundaries as curves, map};
use deadtime::{Error, Task};

use crate::request::Request;

/// A map that is asked for: after the loop, the index of a number and the list of its values, for each
/// axis.
struct Plane<'a> {
    control_loop: ControlLoop,
    axes: [(Place, &'a [f64]); 2],
}

impl<'a> Plane<'a> {
    fn read(request: &mut Request<'a>) -> Result<Self, Error> {
        let control_loop = request.control_loop()?;
        let mut axis = || Ok::<_, Error>((request.place(&control_loop)?, request.list()?));
        let axes = [axis()?, axis()?];
        Ok(Self { control_loop, axes })
    }

    /// The rows of a sampled loop; none of a continuous one.
    fn held(&self) -> Result<Option<HeldPlane>, Error> {
        let varies = self
            .axes
            .iter()
            .any(|(place, _)| *place == Place::SampleTime);
        if !varies && self.control_loop.values().sample_time.is_none() {
            return Ok(None);
        }
        let mut given = |_: &[f64]| Err(Error::argument("a plant of a page has polynomials"));
        HeldPlane::new(&self.control_loop, self.axes, &mut given).map(Some)
    }

    fn family(&self) -> Result<Family, Error> {
        let places = self.axes.map(|(place, _)| place);
        let names = places.iter().map(|place| format!("{place:?}")).collect();
        let free = self.control_loop.free(&places);
        self.control_loop.family(names, &places, &free)
    }

    fn axes(&self) -> [Axis<'a>; 2] {
        let [(_, first), (_, second)] = self.axes;
        [(0, first), (1, second)].map(|(parameter, points)| Axis { parameter, points })
    }
}

/// The answer has a count for each cell, negative where it is not proved (−1 − status), row by row of the
/// first axis.
pub(crate) fn cells(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let plane = Plane::read(request)?;
    let (question, task) = (Question::default(), Task::new());
    let chart = match plane.held()? {
        Some(held) => held.cells(question, &task)?,
        None => {
            let family = plane.family()?;
            map(&family, &[0.0; 2], plane.axes(), question, &task)?
        }
    };
    Ok(listed(&chart))
}

fn listed(chart: &Chart) -> Vec<f64> {
    let counts = chart.unstable.iter().zip(&chart.status);
    let counts = counts.map(|(count, status)| match *status as u8 {
        0 => f64::from(*count),
        status => -1.0 - f64::from(status),
    });
    counts.collect()
}

/// The answer has for each curve the number of its points, and for each of those the values on both
/// axes and the frequency in rad/s.
pub(crate) fn boundaries(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let plane = Plane::read(request)?;
    let task = Task::new();
    let specification = Question::default().specification;
    let found = match plane.held()? {
        Some(held) => Some(held.boundaries(specification, &task)?),
        None => {
            let family = plane.family()?;
            curves(&family, &[0.0; 2], plane.axes(), specification, &task)?
        }
    };
    let found = found.iter().flatten();
    Ok(found.flat_map(|found| plane.listed(found)).collect())
}

impl Plane<'_> {
    /// Curves of two points or more, as the answer has them.
    fn listed(&self, found: &Boundaries) -> Vec<f64> {
        let mut answer = Vec::new();
        let across = self
            .axes
            .get(1 - found.along.min(1))
            .map_or(&[][..], |axis| axis.1);
        for curve in found.curves.iter().filter(|curve| curve.len() > 1) {
            answer.push(curve.len() as f64);
            for vertex in curve {
                let other = across.get(vertex.row).copied().unwrap_or(f64::NAN);
                let [x, y] = if found.along == 0 {
                    [vertex.gain, other]
                } else {
                    [other, vertex.gain]
                };
                answer.extend([x, y, vertex.omega]);
            }
        }
        answer
    }
}
