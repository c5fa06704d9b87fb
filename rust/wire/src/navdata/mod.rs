//! Messages of the drone: a head of 16 bytes, options (tag, size, bytes), and a checksum.
//!
//! A reader uses the sizes that the options state, because firmwares add options and lengthen them
//! at their end. Unknown options are returned unchanged; of longer ones the known fields are read;
//! one that is too short for its fields has none. [`write`](write()) takes the bytes of the options
//! and writes fields over them, so that what was read can be written again, bit by bit.
//!
//! Fields are in SI units (m, m/s, rad, s, V, Pa), with the drone's signs.

mod field;
mod option;
mod packet;
mod table;

pub use option::{Known, Layout, Value};
pub use packet::{Head, LIMIT, OptionView, Packet, read, write};
pub use table::{
    Altitude, Clock, Demo, FULL, KalmanPressure, LAYOUTS, PhysicalMeasures, Pressure, Pwm,
    RawMeasures, RcReferences, References, VideoStream, Wifi,
};
