//! Bindings of the commands of recordings.

use deadtime::estimation::{Controlled, RunCommands, Sent};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::owned;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// Times and commands; unknown and computed ones; ways, longest gap and lost ones; those before.
type SentParts = (
    [Vec<f64>; 2],
    Vec<(f64, f64)>,
    Vec<(f64, f64, f64)>,
    [usize; 3],
    Vec<(f64, f64)>,
);

/// Time, reference, output and command of rows; sample time, gain, limit, and whether that is all of the
/// controller.
type ControlledParts = ([Vec<f64>; 4], Option<f64>, f64, f64, bool);

/// The commands of one recording, as they hold.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct HeldCommands {
    pub(crate) core: RunCommands,
}

#[pymethods]
impl HeldCommands {
    #[new]
    fn new(sent: SentParts, controlled: Option<ControlledParts>) -> Self {
        let ([time, command], unknown, computed, [ways, longest, lost], before) = sent;
        let controlled = controlled.map(|(rows, sample_time, gain, limit, is_proportional)| {
            let [time, reference, output, command] = rows;
            Controlled {
                time,
                reference,
                output,
                command,
                sample_time,
                gain,
                is_proportional,
                limit,
            }
        });
        let sent = Sent {
            time,
            command,
            unknown,
            computed,
            ways,
            longest,
            lost,
        };
        Self {
            core: RunCommands {
                controlled,
                sent,
                before,
            },
        }
    }

    fn __getnewargs__(&self) -> (SentParts, Option<ControlledParts>) {
        let RunCommands {
            controlled,
            sent,
            before,
        } = self.core.clone();
        let controlled = controlled.map(|own| {
            let rows = [own.time, own.reference, own.output, own.command];
            (
                rows,
                own.sample_time,
                own.gain,
                own.limit,
                own.is_proportional,
            )
        });
        let counts = [sent.ways, sent.longest, sent.lost];
        let commands = [sent.time, sent.command];
        (
            (commands, sent.unknown, sent.computed, counts, before),
            controlled,
        )
    }

    /// Commands with times of their own beside these rows; all of them, or with some that were lost.
    #[staticmethod]
    fn with_times(
        time: Floats<'_>,
        command: Floats<'_>,
        rows: Floats<'_>,
        integrates: bool,
        complete: bool,
    ) -> PyResult<Self> {
        let (time, command, rows) = (owned(&time)?, owned(&command)?, owned(&rows)?);
        let sent = if complete {
            Sent::complete(time, command)
        } else {
            Sent::with_lost(time, command, &rows)
        };
        Ok(Self {
            core: RunCommands::of(None, sent, &rows, integrates),
        })
    }

    /// The commands of rows up to the end of a window, and of samples of the controller between them;
    /// `window` has the times of its rows.
    #[staticmethod]
    #[pyo3(signature = (time, reference, output, command, *, sample_time, gain, is_proportional, limit, window, integrates))]
    #[expect(clippy::too_many_arguments, reason = "given by name")]
    fn of_rows(
        time: Floats<'_>,
        reference: Floats<'_>,
        output: Floats<'_>,
        command: Floats<'_>,
        sample_time: Option<f64>,
        gain: f64,
        is_proportional: bool,
        limit: f64,
        window: Floats<'_>,
        integrates: bool,
    ) -> PyResult<Self> {
        let own = Controlled {
            time: owned(&time)?,
            reference: owned(&reference)?,
            output: owned(&output)?,
            command: owned(&command)?,
            sample_time,
            gain,
            is_proportional,
            limit,
        };
        let sent = own.sent(None);
        Ok(Self {
            core: RunCommands::of(Some(own), sent, &owned(&window)?, integrates),
        })
    }

    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.core.sent.time.clone().into_pyarray(py)
    }

    #[getter]
    fn command<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.core.sent.command.clone().into_pyarray(py)
    }

    /// How many mean commands are unknown.
    #[getter]
    fn unknown(&self) -> usize {
        self.core.before.len() + self.core.sent.unknown.len()
    }

    /// Gaps in the log of commands in which some are taken for lost.
    #[getter]
    fn lost(&self) -> usize {
        self.core.sent.lost
    }

    /// Were commands between rows computed?
    #[getter]
    fn are_computed(&self) -> bool {
        self.core.computed().is_some()
    }
}
