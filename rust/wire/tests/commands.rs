//! Commands as drones and their clients exchange them.

#![allow(clippy::unwrap_used)]

mod common;

use common::{config, ids, motion, moved_from, other, reference, unit};
use deadtime_wire::at::{self, Command};
use deadtime_wire::{Fault, Unit};

#[test]
fn commands_are_written_as_known_clients_write_them() {
    let lines: [(&str, u32, Command); 11] = [
        ("AT*PCMD=7,1,0,0,1056964608,0\r", 7, motion(1, 0.5)),
        ("AT*PCMD=8,1,0,0,-1085485875,0\r", 8, motion(1, -0.8)),
        ("AT*REF=3,290718208\r", 3, reference(true, false)),
        ("AT*REF=4,290717696\r", 4, reference(false, false)),
        ("AT*REF=5,290717952\r", 5, reference(false, true)),
        (
            "AT*PCMD_MAG=9,1,0,0,1056964608,0,1048576000,1036831949\r",
            9,
            moved_from(0.5, 0.25, 0.1),
        ),
        (
            "AT*CONFIG_IDS=10,\"00000000\",\"00000001\",\"00000002\"\r",
            10,
            ids(),
        ),
        ("AT*CALIB=11,0\r", 11, Command::Calibrate { device: 0 }),
        ("AT*CTRL=12,5,0\r", 12, Command::Control { mode: 5 }),
        ("AT*FTRIM=13\r", 13, Command::FlatTrim),
        ("AT*COMWDG=14\r", 14, Command::Watchdog),
    ];
    for (line, sequence, command) in lines {
        let written = at::write(std::slice::from_ref(&command), sequence).unwrap();
        assert_eq!(String::from_utf8(written).unwrap(), line);
        assert_eq!(at::read(line.as_bytes()), [(sequence, command)]);
    }
}

#[test]
fn numbers_are_the_bits_of_single_precision() {
    let table: [(f64, i32); 13] = [
        (0.0, 0),
        (-0.0, -2_147_483_648),
        (0.05, 1_028_443_341),
        (-0.05, -1_119_040_307),
        (0.1, 1_036_831_949),
        (-0.1, -1_110_651_699),
        (0.2, 1_045_220_557),
        (-0.2, -1_102_263_091),
        (0.5, 1_056_964_608),
        (-0.5, -1_090_519_040),
        (0.65, 1_059_481_190),
        (1.0, 1_065_353_216),
        (-1.0, -1_082_130_432),
    ];
    for (value, bits) in table {
        assert_eq!(unit(value).to_bits() as i32, bits, "{value}");
        assert_eq!(Unit::from_bits(bits as u32), Some(unit(value)));
    }
}

#[test]
fn a_reader_takes_what_clients_in_the_wild_send() {
    let wild =
        b"AT*PMODE=1,2\rAT*MISC=2,2,20,2000,3000\rAT*REF=0,512\nAT*REF=1,256\r\nAT*REF=2,0\r\
        AT*PCMD=3,3,-2147483648,0,0,0\rAT*FTRIM=4,\rAT*CONFIG=5,\"general:name\",\"a,b\"\r\
        AT*REF=6,4294967295\r AT*REF=7,0\rat*ref=8,0\rAT*COMWDG=9";
    let read = at::read(wild);
    let expected = [
        (1, other("PMODE", &["2"])),
        (2, other("MISC", &["2", "20", "2000", "3000"])),
        (0, reference(true, false)),
        (1, reference(false, true)),
        (2, reference(false, false)),
        (3, motion(3, 0.0)),
        (4, Command::FlatTrim),
        (5, config("general:name", "a,b")),
        (6, reference(true, true)),
    ];
    assert_eq!(read, expected);
}

#[test]
fn malformed_commands_are_left_out_and_their_neighbours_kept() {
    let nan = (f32::NAN.to_bits() as i32).to_string();
    for broken in [
        "PCMD=2,1,0,0,0".to_owned(),
        format!("PCMD=2,1,0,0,{nan},0"),
        "PCMD=2,1,0,0,2139095040,0".to_owned(),
        "PCMD=2,1,0,0,0.5,0".to_owned(),
        "PCMD=2,1,0,0,99999999999,0".to_owned(),
        "REF=-2,0".to_owned(),
        "REF=2".to_owned(),
        "REF=2,x".to_owned(),
        "CONFIG=2,general:name,value".to_owned(),
        "CONFIG=2,\"general:name\"".to_owned(),
        "CONFIG=2,\"a\"b\",\"c\"".to_owned(),
        "LED=2,\"".to_owned(),
        "=2".to_owned(),
        String::new(),
    ] {
        let datagram = format!("AT*REF=1,512\rAT*{broken}\rAT*COMWDG=3\r");
        let read = at::read(datagram.as_bytes());
        let neighbours = [(1, reference(true, false)), (3, Command::Watchdog)];
        assert_eq!(read, neighbours, "{broken}");
    }
    // Its end lies beyond the limit of the drone.
    let datagram = format!("AT*REF=1,512\rAT*LED=2,{}\rAT*COMWDG=3\r", "9".repeat(1002));
    assert_eq!(at::read(datagram.as_bytes()), [(1, reference(true, false))]);
    // Beyond the range, but finite: clipped.
    let clipped = at::read(b"AT*PCMD=2,1,0,0,1088421888,0\r");
    assert_eq!(clipped, [(2, motion(1, 1.0))]);
}

#[test]
fn what_would_break_a_line_is_not_written() {
    let sign = |name, byte| Fault::Sign { name, byte };
    let (length, limit) = (1045, 1024);
    for (command, fault) in [
        (config("a:b", "c\r"), sign("value", b'\r')),
        (config("a\"b", "c"), sign("key", b'"')),
        (config("a:b", "é"), sign("value", 0xc3)),
        (other("LED", &["1,2"]), sign("argument", b',')),
        (other("LED", &["\"1"]), sign("argument", b'"')),
        (other("PCMD", &["1"]), Fault::Name("PCMD".to_owned())),
        (other("", &[]), Fault::Name(String::new())),
        (other("led", &[]), Fault::Name("led".to_owned())),
        (
            config("a:b", &"c".repeat(1024)),
            Fault::Long { length, limit },
        ),
    ] {
        assert_eq!(at::write(&[command], 1).unwrap_err().fault, fault);
    }
    assert!(at::write(&vec![Command::Watchdog; 79], 1).is_ok_and(|text| text.len() <= 1024));
    assert!(at::write(&vec![Command::Watchdog; 80], 1).is_err());
    assert!(at::write(&[Command::Watchdog, Command::Watchdog], i32::MAX as u32).is_err());
}
