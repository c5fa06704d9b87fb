//! Maps over two numbers of a loop.

use deadtime::stability::{
    Axis, Boundaries, Chart, Question, boundaries as curves, held_boundaries, held_map, map,
};
use deadtime::{Error, Task};

use crate::control_loop::{ControlLoop, Number};
use crate::held::Rows;
use crate::request::Request;

/// A map that is asked for: after the loop, the index of a number and the list of its values, for each
/// axis; then the least decay rate, in 1/s.
struct Plane<'a> {
    control_loop: ControlLoop,
    axes: [(Number, &'a [f64]); 2],
    question: Question,
}

impl<'a> Plane<'a> {
    fn read(request: &mut Request<'a>) -> Result<Self, Error> {
        let control_loop = ControlLoop::read(request)?;
        let mut axis = || Ok::<_, Error>((Number::read(request)?, request.list()?));
        let axes = [axis()?, axis()?];
        let mut question = Question::default();
        question.specification.decay = request.number()?;
        Ok(Self {
            control_loop,
            axes,
            question,
        })
    }

    fn is_sampled(&self) -> bool {
        let varies = self
            .axes
            .iter()
            .any(|(number, _)| *number == Number::SampleTime);
        varies || self.control_loop.sample_time().is_some()
    }

    fn axes(&self) -> [Axis<'a>; 2] {
        let [(_, first), (_, second)] = self.axes;
        [(0, first), (1, second)].map(|(parameter, points)| Axis { parameter, points })
    }

    /// The axis along the rows of a sampled map: a gain.
    fn along(&self) -> Result<usize, Error> {
        let found = self.control_loop.along(self.axes);
        found.ok_or_else(|| {
            Error::argument("a map of a sampled loop needs a gain as one of its axes")
        })
    }

    /// The rows of a sampled map along one of its axes, and the column through their middle where the
    /// other number is a gain too.
    fn rows(&self, along: usize) -> Result<(Rows, Option<Rows>), Error> {
        let [first, second] = self.axes;
        let (row, across) = if along == 0 {
            (first, second)
        } else {
            (second, first)
        };
        let values: Vec<_> = across.1.iter().map(|point| (across.0, *point)).collect();
        let rows = self.control_loop.rows(&values, Some(row))?;
        let column = if across.0.is_gain() {
            let middle = row.1.get(row.1.len() / 2).map(|point| (row.0, *point));
            let middle: Vec<_> = middle.into_iter().collect();
            Some(self.control_loop.rows(&middle, Some(across))?)
        } else {
            None
        };
        Ok((rows, column))
    }
}

/// After the map, whether abscissas are asked for (0 or 1). The answer has a count for each cell,
/// negative where it is not proved (−1 − status), and then the abscissas, both row by row of the
/// first axis.
pub(crate) fn cells(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let mut plane = Plane::read(request)?;
    plane.question.abscissa = request.flag()?;
    let task = Task::new();
    let chart = if plane.is_sampled() {
        let along = plane.along()?;
        let (rows, column) = plane.rows(along)?;
        let column = column.as_ref().map(Rows::view);
        held_map(
            &rows.view(),
            column.as_ref(),
            plane.question,
            along == 0,
            &task,
        )?
    } else {
        let family = plane
            .control_loop
            .family(plane.axes.map(|(name, _)| name))?;
        map(&family, &[0.0; 2], plane.axes(), plane.question, &task)?
    };
    Ok(listed(&chart))
}

fn listed(chart: &Chart) -> Vec<f64> {
    let counts = chart.unstable.iter().zip(&chart.status);
    let counts = counts.map(|(count, status)| match *status as u8 {
        0 => f64::from(*count),
        status => -1.0 - f64::from(status),
    });
    counts.chain(chart.abscissa.iter().copied()).collect()
}

/// The answer has for each curve the number of its points, and for each of those the values on both
/// axes and the frequency in rad/s.
pub(crate) fn boundaries(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let plane = Plane::read(request)?;
    let task = Task::new();
    let specification = plane.question.specification;
    let found = if plane.is_sampled() {
        let along = plane.along()?;
        let (rows, _) = plane.rows(along)?;
        let other = plane.axes.get(1 - along);
        let columns = if other.is_some_and(|axis| axis.0.is_gain()) {
            Some(plane.rows(1 - along)?.0)
        } else {
            None
        };
        let columns = columns.as_ref().map(|columns| columns.view());
        let [curves, others] =
            held_boundaries(&rows.view(), columns.as_ref(), specification, &task)?;
        let of = |along, curves| Boundaries { along, curves };
        Some([of(along, curves), of(1 - along, others)])
    } else {
        let family = plane
            .control_loop
            .family(plane.axes.map(|(name, _)| name))?;
        curves(&family, &[0.0; 2], plane.axes(), specification, &task)?
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
