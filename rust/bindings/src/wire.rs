//! Wire formats: bytes to what they say, and back. What is wrong with bytes is a `PacketError`, what
//! cannot be written a `ValueError`.

use crate::errors::own;
use crate::runtime;
use deadtime_wire::at::{self, Command};
use deadtime_wire::blackbox::{self, Fields, Layout, Table};
use deadtime_wire::loop_packet::{self, LoopPacket};
use deadtime_wire::navdata::{self, Head, LAYOUTS, OptionView, Value};
use deadtime_wire::{Error, Fault, Unit, configuration};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
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
type Encoded<'py> = (String, Bound<'py, PyTuple>);

/// A command of a datagram.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct AtCommand {
    sequence: u32,
    name: &'static str,
    arguments: Py<PyAny>,
}

/// The bytes of commands with the sequence numbers `first`, `first + 1`, …
#[pyfunction]
pub(crate) fn at_write<'py>(
    py: Python<'py>,
    commands: Vec<Encoded<'py>>,
    first: u32,
) -> PyResult<Bound<'py, PyBytes>> {
    let commands: Vec<Command> = commands.iter().map(command).collect::<PyResult<_>>()?;
    let bytes = at::write(&commands, first).map_err(|error| unwritable("commands", &error))?;
    Ok(PyBytes::new(py, &bytes))
}

fn unit(value: f64) -> PyResult<Unit> {
    Unit::new(value).map_err(|fault| unwritable("command", &fault))
}

fn command((name, arguments): &Encoded<'_>) -> PyResult<Command> {
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

/// The commands of a datagram.
#[pyfunction]
pub(crate) fn at_read(py: Python<'_>, datagram: &[u8]) -> PyResult<Vec<AtCommand>> {
    at::read(datagram)
        .into_iter()
        .map(|(sequence, command)| {
            let (name, arguments) = decoded(py, command)?;
            Ok(AtCommand {
                sequence,
                name,
                arguments: arguments.unbind(),
            })
        })
        .collect()
}

fn decoded(py: Python<'_>, command: Command) -> PyResult<(&'static str, Bound<'_, PyAny>)> {
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

/// A packet of navdata.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct Navdata {
    header: u32,
    state: u32,
    sequence: u32,
    vision: u32,
    options: Vec<Py<NavdataOption>>,
    checksum_matches: bool,
}

/// An option of navdata: the values of its fields where they are known, in their order.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct NavdataOption {
    tag: u16,
    body: Py<PyBytes>,
    values: Option<Py<PyTuple>>,
}

/// An option whose fields are known; `length` is without tag and size. Each field has its name,
/// what it is, and the value of an option of zeros, which shows its type.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct NavdataLayout {
    tag: u16,
    length: usize,
    name: &'static str,
    doc: &'static str,
    fields: Vec<(&'static str, &'static str, Py<PyAny>)>,
}

/// Values of the fields of an option, as Python's numbers.
fn numbers<'py>(py: Python<'py>, values: &[Value]) -> PyResult<Bound<'py, PyTuple>> {
    let objects = values.iter().map(|value| match *value {
        Value::Integer(value) => value.into_pyobject(py).map(Bound::into_any),
        Value::Real(value) => value.into_pyobject(py).map(Bound::into_any),
    });
    PyTuple::new(py, objects.collect::<Result<Vec<_>, _>>()?)
}

/// Read a packet; with `verify` a checksum that does not match is an error.
#[pyfunction]
pub(crate) fn navdata_read(py: Python<'_>, packet: &[u8], verify: bool) -> PyResult<Navdata> {
    let read = navdata::read(packet, verify).map_err(|error| unreadable(py, "navdata", &error))?;
    let options = read.options.iter().map(|option| {
        let values = option.values();
        let values = values.map(|values| numbers(py, &values)).transpose()?;
        let option = NavdataOption {
            tag: option.tag,
            body: PyBytes::new(py, option.bytes).unbind(),
            values: values.map(Bound::unbind),
        };
        Py::new(py, option)
    });
    Ok(Navdata {
        header: read.head.header,
        state: read.head.state,
        sequence: read.head.sequence,
        vision: read.head.vision,
        options: options.collect::<PyResult<_>>()?,
        checksum_matches: read.checksum_matches,
    })
}

/// The packet of a head and options; values are written over the bytes of their option.
#[pyfunction]
#[pyo3(signature = (options, *, header, state, sequence, vision))]
pub(crate) fn navdata_write<'py>(
    py: Python<'py>,
    options: Vec<(u16, Vec<u8>, Option<Bound<'py, PyTuple>>)>,
    header: u32,
    state: u32,
    sequence: u32,
    vision: u32,
) -> PyResult<Bound<'py, PyBytes>> {
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

/// Every option whose fields are known.
#[pyfunction]
pub(crate) fn navdata_layouts(py: Python<'_>) -> PyResult<Vec<NavdataLayout>> {
    let layouts = LAYOUTS.iter().map(|layout| {
        let zeros = layout.read(&vec![0; layout.length]).unwrap_or_default();
        let zeros = numbers(py, &zeros)?;
        let fields = layout.fields.iter().zip(&zeros);
        Ok(NavdataLayout {
            tag: layout.tag,
            length: layout.length,
            name: layout.name,
            doc: layout.doc,
            fields: fields
                .map(|(&(name, doc), zero)| (name, doc, zero.unbind()))
                .collect(),
        })
    });
    layouts.collect()
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

/// What travels between the two ends of a loop over UDP.
#[pyclass(frozen, get_all, name = "LoopPacket", module = "deadtime._deadtime")]
pub(crate) struct PyLoopPacket {
    sequence: u32,
    sent: f64,
    echo_sequence: u32,
    echo_sent: f64,
    held: f64,
    value: f64,
    reference: f64,
    flags: u32,
}

/// Read a packet of a loop.
#[pyfunction]
pub(crate) fn loop_packet_read(py: Python<'_>, packet: &[u8]) -> PyResult<PyLoopPacket> {
    let found = loop_packet::read(packet);
    let found = found.map_err(|error| unreadable(py, "packet of a loop", &error))?;
    Ok(PyLoopPacket {
        sequence: found.sequence,
        sent: found.sent,
        echo_sequence: found.echo_sequence,
        echo_sent: found.echo_sent,
        held: found.held,
        value: found.value,
        reference: found.reference,
        flags: found.flags,
    })
}

/// The bytes of a packet of a loop.
#[pyfunction]
#[pyo3(signature = (*, sequence, sent, echo_sequence, echo_sent, held, value, reference, flags))]
#[expect(clippy::too_many_arguments, reason = "the fields of a packet, by name")]
pub(crate) fn loop_packet_write(
    py: Python<'_>,
    sequence: u32,
    sent: f64,
    echo_sequence: u32,
    echo_sent: f64,
    held: f64,
    value: f64,
    reference: f64,
    flags: u32,
) -> PyResult<Bound<'_, PyBytes>> {
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

/// Read `count` bare doubles.
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

/// The codes of encodings and predictors of the fields of a frame.
type Codes = (Vec<u8>, Vec<u8>);

/// What the head of a Blackbox log says of its frames.
#[derive(FromPyObject)]
pub(crate) struct BlackboxLayout {
    intra: Codes,
    inter: Option<Codes>,
    slow: Option<Codes>,
    gps: Option<Codes>,
    home: Option<Codes>,
    iteration: usize,
    time: usize,
    first_motor: Option<usize>,
    least_throttle: i32,
    least_motor: i32,
    voltage: i32,
    interval: u32,
    logged: (u32, u32),
}

impl TryFrom<BlackboxLayout> for Layout {
    type Error = Fault;

    fn try_from(given: BlackboxLayout) -> Result<Self, Fault> {
        let fields = |(encodings, predictors): Codes| Fields::new(&encodings, &predictors);
        Ok(Self {
            intra: fields(given.intra)?,
            inter: given.inter.map(fields).transpose()?,
            slow: given.slow.map(fields).transpose()?,
            gps: given.gps.map(fields).transpose()?,
            home: given.home.map(fields).transpose()?,
            iteration: given.iteration,
            time: given.time,
            first_motor: given.first_motor,
            least_throttle: given.least_throttle,
            least_motor: given.least_motor,
            voltage: given.voltage,
            interval: given.interval,
            logged: given.logged,
        })
    }
}

/// Frames of a Blackbox log: a row for each field, a column for each frame; and how many main
/// frames stand before each of the others.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct BlackboxFrames {
    main: Py<PyArray2<i32>>,
    slow: Py<PyArray2<i32>>,
    slow_before: Py<PyArray1<u32>>,
    gps: Py<PyArray2<i32>>,
    gps_before: Py<PyArray1<u32>>,
    ended: bool,
    damaged: u32,
    unusable: u32,
}

/// The frames of a Blackbox log without its head, with `limit` values at most.
#[pyfunction]
pub(crate) fn blackbox_frames(
    py: Python<'_>,
    log: &[u8],
    layout: BlackboxLayout,
    limit: usize,
) -> PyResult<BlackboxFrames> {
    let unreadable = |fault: Fault| own(py, "RecordingError", (fault.to_string(),));
    let layout = Layout::try_from(layout).map_err(unreadable)?;
    let frames = runtime::run(py, None, None, |_| Ok(blackbox::read(log, &layout, limit)))?;
    let frames = frames.map_err(unreadable)?;
    let array = |table: Table| {
        let fields = table.values.len().checked_div(table.rows).unwrap_or(0);
        let values = Array2::from_shape_vec((fields, table.rows), table.values);
        let values = values.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let before = table.before.into_pyarray(py).unbind();
        Ok::<_, PyErr>((values.into_pyarray(py).unbind(), before))
    };
    let (main, _) = array(frames.main)?;
    let (slow, slow_before) = array(frames.slow)?;
    let (gps, gps_before) = array(frames.gps)?;
    Ok(BlackboxFrames {
        main,
        slow,
        slow_before,
        gps,
        gps_before,
        ended: frames.ended,
        damaged: frames.damaged,
        unusable: frames.unusable,
    })
}
