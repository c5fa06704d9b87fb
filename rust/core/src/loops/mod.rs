//! Feedback loops with a delay: plant × controller × paths, and everything that follows from them.
//!
//! * `entry` is what the formulas are written over, `each` the numbers of many loops, `symbol`
//!   polynomials in free numbers, `polynomial` those in s.
//! * `plant`, `filter` and `controller` are the parts, `control_loop` joins them and names their
//!   numbers.
//! * `equations` closes the loop for the steppers of `dde`, `drive` has what drives it besides the
//!   reference, `inputs` adds that, `load` measures the response to it, `rest` is where a run starts,
//!   `settled` how slow its parts are, `slopes` has derivatives of a response, `sweep` many loops, and
//!   `settling` whether their responses settle.
//! * `characteristic` has the characteristic function, families of it and transfer functions, `held`
//!   the rows of a map of a sampled loop, `plane` that map, and `range` the stable values of a number.

mod characteristic;
mod control_loop;
mod controller;
mod drive;
mod each;
mod entry;
mod equations;
mod filter;
mod held;
mod inputs;
mod load;
mod plane;
mod plant;
mod polynomial;
mod range;
mod rest;
mod settled;
mod settling;
mod slopes;
mod sweep;
mod symbol;

pub use control_loop::{ControlLoop, Path, Place, Values};
pub use controller::{Controller, Extra, Extras, Kind};
pub use drive::Drive;
pub use each::Each;
pub use entry::{Entry, Number};
pub use equations::Input;
pub use filter::{Rule, SampledFilter};
pub use held::{HeldRows, Moving, Polynomials};
pub use load::{DeviationAsked, Figures, MOST_DELAYS};
pub use plane::HeldPlane;
pub use plant::{Factors, Fraction, Plant, StateSpace};
pub use range::GivenPlant;
pub use settling::{SweptMetrics, first_duration};
pub use slopes::SlopesAsked;
pub use sweep::{Resting, SweptLoops};
pub use symbol::{Monomial, Symbol};
