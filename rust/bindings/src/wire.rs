//! Wire formats: bytes to tuples and back. What is wrong with bytes is a `PacketError`, what cannot
//! be written a `ValueError`.

use crate::errors::own;
use deadtime_wire::at::{self, Command};
use deadtime_wire::loop_packet::{self, LoopPacket};
use deadtime_wire::navdata::{self, Head, LAYOUTS, OptionView, Value};
use deadtime_wire::{Error, Unit, configuration};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};

/// The exception for bytes that are no packet.
fn unreadable(py: Python<'_>, what: &str, error: &Error) -> PyErr {
    own(py, "PacketError", (format!("{what}: {error}"),))
}

/// The exception for something that cannot be written.
fn unwritable(what: &str, error: &impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("{what}: {error}"))
}

/// A command as its name on the wire and its arguments; "OTHER" with name and arguments.
type Spoken<'py> = (String, Bound<'py, PyTuple>);

/// The bytes of commands with the sequence numbers `first`, `first + 1`, …
#[pyfunction]
pub(crate) fn at_write<'py>(
    py: Python<'py>,
    commands: Vec<Spoken<'py>>,
    first: u32,
) -> PyResult<Bound<'py, PyBytes>> {
    let commands: Vec<Command> = commands.iter().map(command).collect::<PyResult<_>>()?;
    let bytes = at::write(&commands, first).map_err(|error| unwritable("commands", &error))?;
    Ok(PyBytes::new(py, &bytes))
}

fn unit(value: f64) -> PyResult<Unit> {
    Unit::new(value).map_err(|fault| unwritable("command", &fault))
}

fn command((name, arguments): &Spoken<'_>) -> PyResult<Command> {
    Ok(match name.as_str() {
        "REF" => {
            let (take_off, emergency) = arguments.extract()?;
            Command::Ref {
                take_off,
                emergency,
            }
        }
        "PCMD" => {
            let (flag, roll, pitch, gaz, yaw) = arguments.extract()?;
            Command::Move {
                flag,
                roll: unit(roll)?,
                pitch: unit(pitch)?,
                gaz: unit(gaz)?,
                yaw: unit(yaw)?,
            }
        }
        "PCMD_MAG" => {
            let (flag, roll, pitch, gaz, yaw, heading, accuracy) = arguments.extract()?;
            Command::MoveFrom {
                flag,
                roll: unit(roll)?,
                pitch: unit(pitch)?,
                gaz: unit(gaz)?,
                yaw: unit(yaw)?,
                heading: unit(heading)?,
                accuracy: unit(accuracy)?,
            }
        }
        "CONFIG" => {
            let (key, value) = arguments.extract()?;
            Command::Config { key, value }
        }
        "CONFIG_IDS" => {
            let (session, user, application) = arguments.extract()?;
            Command::ConfigIds {
                session,
                user,
                application,
            }
        }
        "CTRL" => {
            let (mode,) = arguments.extract()?;
            Command::Control { mode }
        }
        "COMWDG" => Command::Watchdog,
        "FTRIM" => Command::FlatTrim,
        "CALIB" => {
            let (device,) = arguments.extract()?;
            Command::Calibrate { device }
        }
        _ => {
            let (name, arguments) = arguments.extract()?;
            Command::Other { name, arguments }
        }
    })
}

/// Sequence number, name and arguments of each command of a datagram.
#[pyfunction]
pub(crate) fn at_read<'py>(
    py: Python<'py>,
    datagram: &[u8],
) -> PyResult<Vec<(u32, &'static str, Bound<'py, PyAny>)>> {
    at::read(datagram)
        .into_iter()
        .map(|(sequence, command)| {
            let (name, arguments) = spoken(py, command)?;
            Ok((sequence, name, arguments))
        })
        .collect()
}

fn spoken(py: Python<'_>, command: Command) -> PyResult<(&'static str, Bound<'_, PyAny>)> {
    Ok(match command {
        Command::Ref {
            take_off,
            emergency,
        } => ("REF", (take_off, emergency).into_pyobject(py)?.into_any()),
        Command::Move {
            flag,
            roll,
            pitch,
            gaz,
            yaw,
        } => {
            let arguments = (flag, roll.get(), pitch.get(), gaz.get(), yaw.get());
            ("PCMD", arguments.into_pyobject(py)?.into_any())
        }
        Command::MoveFrom {
            flag,
            roll,
            pitch,
            gaz,
            yaw,
            heading,
            accuracy,
        } => {
            let (roll, pitch, gaz, yaw) = (roll.get(), pitch.get(), gaz.get(), yaw.get());
            let arguments = (flag, roll, pitch, gaz, yaw, heading.get(), accuracy.get());
            ("PCMD_MAG", arguments.into_pyobject(py)?.into_any())
        }
        Command::Config { key, value } => ("CONFIG", (key, value).into_pyobject(py)?.into_any()),
        Command::ConfigIds {
            session,
            user,
            application,
        } => {
            let arguments = (session, user, application);
            ("CONFIG_IDS", arguments.into_pyobject(py)?.into_any())
        }
        Command::Control { mode } => ("CTRL", (mode,).into_pyobject(py)?.into_any()),
        Command::Watchdog => ("COMWDG", PyTuple::empty(py).into_any()),
        Command::FlatTrim => ("FTRIM", PyTuple::empty(py).into_any()),
        Command::Calibrate { device } => ("CALIB", (device,).into_pyobject(py)?.into_any()),
        Command::Other { name, arguments } => {
            ("OTHER", (name, arguments).into_pyobject(py)?.into_any())
        }
    })
}

/// Header, state, sequence number and vision word of navdata.
type Words = (u32, u32, u32, u32);

/// Values of the fields of an option, as Python's numbers.
fn numbers<'py>(py: Python<'py>, values: &[Value]) -> PyResult<Bound<'py, PyTuple>> {
    let objects = values.iter().map(|value| match *value {
        Value::Integer(value) => value.into_pyobject(py).map(Bound::into_any),
        Value::Real(value) => value.into_pyobject(py).map(Bound::into_any),
    });
    PyTuple::new(py, objects.collect::<Result<Vec<_>, _>>()?)
}

/// An option: its tag, its bytes, the values of its fields where they are known.
type Told<'py> = (u16, Bound<'py, PyBytes>, Option<Bound<'py, PyTuple>>);

/// Head, options and whether the checksum matches; with `verify` one that does not is an error.
#[pyfunction]
pub(crate) fn navdata_read<'py>(
    py: Python<'py>,
    packet: &[u8],
    verify: bool,
) -> PyResult<(Words, Vec<Told<'py>>, bool)> {
    let read = navdata::read(packet, verify).map_err(|error| unreadable(py, "navdata", &error))?;
    let options = read.options.iter().map(|option| {
        let values = option.values();
        let values = values.map(|values| numbers(py, &values)).transpose()?;
        Ok((option.tag, PyBytes::new(py, option.bytes), values))
    });
    let head = read.head;
    let words = (head.header, head.state, head.sequence, head.vision);
    Ok((
        words,
        options.collect::<PyResult<_>>()?,
        read.checksum_matches,
    ))
}

/// The packet of a head and options; values are written over the bytes of their option.
#[pyfunction]
pub(crate) fn navdata_write<'py>(
    py: Python<'py>,
    head: Words,
    options: Vec<(u16, Vec<u8>, Option<Bound<'py, PyTuple>>)>,
) -> PyResult<Bound<'py, PyBytes>> {
    let (header, state, sequence, vision) = head;
    let head = Head {
        header,
        state,
        sequence,
        vision,
    };
    let written: Vec<(u16, Vec<u8>)> = options
        .into_iter()
        .map(|(tag, mut bytes, values)| {
            let layout = LAYOUTS.iter().find(|layout| layout.tag == tag);
            if let (Some(values), Some(layout)) = (values, layout) {
                let values: Vec<Value> =
                    values.iter().map(|v| value(&v)).collect::<PyResult<_>>()?;
                let what = || format!("{} option of navdata", layout.name);
                layout
                    .write(&mut bytes, &values)
                    .map_err(|error| unwritable(&what(), &error))?;
            }
            Ok((tag, bytes))
        })
        .collect::<PyResult<_>>()?;
    let views: Vec<OptionView<'_>> = written
        .iter()
        .map(|(tag, bytes)| OptionView { tag: *tag, bytes })
        .collect();
    let packet = navdata::write(&head, &views).map_err(|error| unwritable("navdata", &error))?;
    Ok(PyBytes::new(py, &packet))
}

fn value(object: &Bound<'_, PyAny>) -> PyResult<Value> {
    match object.extract::<i64>() {
        Ok(integer) => Ok(Value::Integer(integer)),
        Err(_) => object.extract::<f64>().map(Value::Real),
    }
}

/// Tag, length without tag and size, name and fields of every option whose fields are known.
#[pyfunction]
pub(crate) fn navdata_layouts() -> Vec<(u16, usize, &'static str, Vec<&'static str>)> {
    LAYOUTS
        .iter()
        .map(|layout| {
            (
                layout.tag,
                layout.length,
                layout.name,
                layout.fields.to_vec(),
            )
        })
        .collect()
}

/// Tag and length, without tag and size, of every option of a full packet.
#[pyfunction]
pub(crate) fn navdata_full() -> Vec<(u16, usize)> {
    navdata::FULL
        .iter()
        .map(|&(tag, size)| (tag, size - 4))
        .collect()
}

/// Keys and values of a configuration, in their order.
#[pyfunction]
pub(crate) fn configuration_read(py: Python<'_>, dump: &[u8]) -> PyResult<Vec<(String, String)>> {
    let read = configuration::read(dump);
    let settings = read.map_err(|error| unreadable(py, "configuration", &error))?;
    Ok(settings
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect())
}

/// The bytes of a configuration.
#[pyfunction]
pub(crate) fn configuration_write<'py>(
    py: Python<'py>,
    settings: Vec<(String, String)>,
) -> PyResult<Bound<'py, PyBytes>> {
    let borrowed: Vec<(&str, &str)> = settings
        .iter()
        .map(|(key, value)| (key.as_str(), value.as_str()))
        .collect();
    let dump = configuration::write(&borrowed);
    let dump = dump.map_err(|error| unwritable("configuration", &error))?;
    Ok(PyBytes::new(py, &dump))
}

/// Sequence, sent, echo_sequence, echo_sent, held, value, reference and flags of a loop's packet.
type LoopFields = (u32, f64, u32, f64, f64, f64, f64, u32);

/// The fields of a loop's packet.
#[pyfunction]
pub(crate) fn loop_packet_read(py: Python<'_>, packet: &[u8]) -> PyResult<LoopFields> {
    let found = loop_packet::read(packet);
    let found = found.map_err(|error| unreadable(py, "packet of a loop", &error))?;
    Ok((
        found.sequence,
        found.sent,
        found.echo_sequence,
        found.echo_sent,
        found.held,
        found.value,
        found.reference,
        found.flags,
    ))
}

/// The bytes of a loop's packet.
#[pyfunction]
pub(crate) fn loop_packet_write<'py>(
    py: Python<'py>,
    fields: LoopFields,
) -> PyResult<Bound<'py, PyBytes>> {
    let (sequence, sent, echo_sequence, echo_sent, held, value, reference, flags) = fields;
    let packet = LoopPacket {
        flags,
        sequence,
        echo_sequence,
        sent,
        echo_sent,
        held,
        value,
        reference,
    };
    let bytes = loop_packet::write(&packet);
    let bytes = bytes.map_err(|error| unwritable("packet of a loop", &error))?;
    Ok(PyBytes::new(py, &bytes))
}

/// So many bare doubles.
#[pyfunction]
pub(crate) fn doubles_read(py: Python<'_>, packet: &[u8], count: usize) -> PyResult<Vec<f64>> {
    let values = loop_packet::read_doubles(packet, count);
    values.map_err(|error| unreadable(py, "doubles", &error))
}

/// The bytes of bare doubles.
#[pyfunction]
pub(crate) fn doubles_write(py: Python<'_>, values: Vec<f64>) -> PyResult<Bound<'_, PyBytes>> {
    let bytes = loop_packet::write_doubles(&values);
    let bytes = bytes.map_err(|error| unwritable("doubles", &error))?;
    Ok(PyBytes::new(py, &bytes))
}
