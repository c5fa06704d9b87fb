//! Packets to test with, all written by the crate itself.

#![allow(dead_code, clippy::unwrap_used, clippy::indexing_slicing)]

pub(crate) mod checks;

use deadtime_wire::at::{self, Command};
use deadtime_wire::loop_packet::{self, LoopPacket};
use deadtime_wire::navdata::{self, Demo, Head, KalmanPressure, Known, OptionView, Pwm};
use deadtime_wire::{Unit, configuration};

/// A real packet of a drone that waits to be configured.
pub(crate) const BOOTSTRAP: [u8; 24] = [
    0x88, 0x77, 0x66, 0x55, 0x10, 0x0c, 0x80, 0x4f, 1, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 8, 0, 0xa6,
    2, 0, 0,
];

pub(crate) fn unit(value: f64) -> Unit {
    Unit::new(value).unwrap()
}

pub(crate) fn motion(flag: i32, gaz: f64) -> Command {
    let (roll, pitch, yaw) = (Unit::ZERO, Unit::ZERO, Unit::ZERO);
    Command::Move {
        flag,
        roll,
        pitch,
        gaz: unit(gaz),
        yaw,
    }
}

pub(crate) fn reference(take_off: bool, emergency: bool) -> Command {
    Command::Ref {
        take_off,
        emergency,
    }
}

pub(crate) fn config(key: &str, value: &str) -> Command {
    let (key, value) = (key.to_owned(), value.to_owned());
    Command::Config { key, value }
}

pub(crate) fn ids() -> Command {
    Command::ConfigIds {
        session: "00000000".to_owned(),
        user: "00000001".to_owned(),
        application: "00000002".to_owned(),
    }
}

pub(crate) fn other(name: &str, arguments: &[&str]) -> Command {
    Command::Other {
        name: name.to_owned(),
        arguments: arguments
            .iter()
            .map(|&argument| argument.to_owned())
            .collect(),
    }
}

pub(crate) fn moved_from(gaz: f64, heading: f64, accuracy: f64) -> Command {
    let (roll, pitch, yaw) = (Unit::ZERO, Unit::ZERO, Unit::ZERO);
    Command::MoveFrom {
        flag: 1,
        roll,
        pitch,
        gaz: unit(gaz),
        yaw,
        heading: unit(heading),
        accuracy: unit(accuracy),
    }
}

/// A packet with the options of these tags, zero but for height, climb and its demand.
pub(crate) fn navdata_with(tags: impl Fn(u16) -> bool) -> Vec<u8> {
    let mut bodies: Vec<(u16, Vec<u8>)> = navdata::FULL
        .iter()
        .filter(|(tag, _)| tags(*tag))
        .map(|&(tag, size)| (tag, vec![0; size - 4]))
        .collect();
    for (tag, body) in &mut bodies {
        if *tag == Demo::LAYOUT.tag {
            let (height, major, battery, pitch) = (1.104, 3, 68, -0.02);
            let demo = Demo {
                height,
                major,
                battery,
                pitch,
                ..Demo::default()
            };
            demo.write(body).unwrap();
        } else if *tag == Pwm::LAYOUT.tag {
            let vz_ref = -0.05;
            Pwm {
                vz_ref,
                ..Pwm::default()
            }
            .write(body)
            .unwrap();
        } else if *tag == KalmanPressure::LAYOUT.tag {
            let (est_z, est_zdot) = (1.1, 0.24);
            let option = KalmanPressure {
                est_z,
                est_zdot,
                ..KalmanPressure::default()
            };
            option.write(body).unwrap();
        }
    }
    let options: Vec<OptionView<'_>> = bodies
        .iter()
        .map(|(tag, bytes)| OptionView { tag: *tag, bytes })
        .collect();
    let (state, sequence) = (0x0f80_00f5, 308_119);
    let head = Head {
        state,
        sequence,
        ..Head::default()
    };
    navdata::write(&head, &options).unwrap()
}

pub(crate) fn full() -> Vec<u8> {
    navdata_with(|_| true)
}

pub(crate) fn demo() -> Vec<u8> {
    navdata_with(|tag| tag == 0 || tag == 16)
}

/// Datagrams of navdata.
pub(crate) fn navdata_corpus() -> Vec<Vec<u8>> {
    vec![
        full(),
        demo(),
        navdata_with(|tag| tag == 0),
        BOOTSTRAP.to_vec(),
    ]
}

/// Datagrams of commands.
pub(crate) fn at_corpus() -> Vec<Vec<u8>> {
    let polite = [
        other("PMODE", &["2"]),
        other("MISC", &["2", "20", "2000", "3000"]),
        reference(true, false),
        motion(1, 0.5),
    ];
    let settings = [
        ids(),
        config("control:altitude_max", "3000"),
        Command::Control { mode: 5 },
        Command::Watchdog,
    ];
    let rest = [
        Command::FlatTrim,
        Command::Calibrate { device: 0 },
        moved_from(0.5, 0.25, 0.1),
        other("LED", &["1", "1073741824", "3"]),
        reference(false, true),
    ];
    let mut corpus: Vec<Vec<u8>> = [&polite[..], &settings[..], &rest[..]]
        .iter()
        .map(|commands| at::write(commands, 7).unwrap())
        .collect();
    corpus.push(b"AT*PCMD=8,3,-2147483648,0,-1085485875,0\nAT*REF=9,512\r\n".to_vec());
    corpus.push(at::write(&vec![motion(1, -0.8); 25], 1).unwrap());
    corpus
}

/// Configurations.
pub(crate) fn configuration_corpus() -> Vec<Vec<u8>> {
    let settings = [
        ("general:navdata_demo", "TRUE"),
        ("general:navdata_options", "65537"),
        ("general:ardrone_name", "My ARDrone"),
        ("general:localtime", "0"),
        ("control:control_vz_max", "7.000000e+02"),
        ("control:altitude_max", "3000"),
        ("control:accs_gains", "{ 9.8e-01 -1.2e-02 3.4e-03 }"),
        ("custom:application_desc", ""),
    ];
    let long: Vec<(String, String)> = (0..120)
        .map(|at| (format!("section{}:key_{at}", at % 9), format!("value {at}")))
        .collect();
    let long: Vec<(&str, &str)> = long.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    vec![
        configuration::write(&settings).unwrap(),
        configuration::write(&long).unwrap(),
        vec![0],
    ]
}

/// Packets of a loop.
pub(crate) fn loop_corpus() -> Vec<Vec<u8>> {
    let question = LoopPacket {
        sequence: 1,
        sent: 12.5,
        value: -0.25,
        reference: 1.0,
        ..LoopPacket::default()
    };
    let answer = LoopPacket {
        flags: 1,
        sequence: 9,
        echo_sequence: 1,
        sent: 100.0,
        echo_sent: 12.5,
        held: 1e-4,
        value: 1.0,
        reference: 0.0,
    };
    [question, answer]
        .iter()
        .map(|packet| loop_packet::write(packet).unwrap())
        .collect()
}

/// Frames of Blackbox logs, with the layout of [`checks::blackbox_layout`].
pub(crate) fn blackbox_corpus() -> Vec<Vec<u8>> {
    let intra = |iteration: u8, time: u8| {
        let mut frame = vec![b'I', iteration, time, 3, 5, 40, 7, 8, 1, 2];
        // Four values of 0, 4, 8 and 16 bits; three of 5, 5 and 4.
        frame.extend([0b11_10_01_00, 0x78, 0x07, 0xff, 0xf0, 0b0110_0000, 0xf8]);
        frame
    };
    let inter = [
        b'P',
        4,
        0b01,
        0x70,
        0b0100_0111,
        0x8f,
        0b0101,
        2,
        3,
        0b00_01_10_11,
    ];
    let slow = [b'S', 3, 8, 0b00_00_01_01];
    let (home, gps) = ([b'H', 20, 21], [b'G', 9, 2, 3, 11]);
    let end = b"E\xffEnd of log\0";
    let short = [&intra(0, 10)[..], &slow, &inter, end].concat();
    let mut long = intra(0, 10);
    for number in 1..16u8 {
        long.extend(slow);
        if number % 4 == 0 {
            long.extend(intra(8 * (number / 4), 10 + 2 * number));
            long.extend(home);
            long.extend(gps);
        } else {
            long.extend(inter);
        }
        long.extend([b'E', 30, number, 1]);
    }
    long.extend([b'E', 14, 90, 100]);
    long.extend(intra(96, 101));
    long.extend(end);
    vec![short, long]
}
