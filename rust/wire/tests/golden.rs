//! Bytes that drones and their clients are known to exchange.

#![allow(clippy::unwrap_used)]

mod common;

use common::{BOOTSTRAP, config, full, ids, motion, moved_from, other, reference, unit};
use deadtime_wire::at::{self, Command};
use deadtime_wire::navdata::{self, Clock, Demo, Head, KalmanPressure, Known, OptionView, Pwm};
use deadtime_wire::{Fault, Unit, configuration, loop_packet};

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
        assert_eq!(
            read,
            [(1, reference(true, false)), (3, Command::Watchdog)],
            "{broken}"
        );
    }
    // Its end lies beyond what the drone reads.
    let datagram = format!("AT*REF=1,512\rAT*LED=2,{}\rAT*COMWDG=3\r", "9".repeat(1002));
    assert_eq!(at::read(datagram.as_bytes()), [(1, reference(true, false))]);
    // Beyond the range, but finite: clipped.
    assert_eq!(
        at::read(b"AT*PCMD=2,1,0,0,1088421888,0\r"),
        [(2, motion(1, 1.0))]
    );
}

#[test]
fn what_would_break_a_line_is_not_written() {
    for (command, fault) in [
        (
            config("a:b", "c\r"),
            Fault::Sign {
                name: "value",
                byte: b'\r',
            },
        ),
        (
            config("a\"b", "c"),
            Fault::Sign {
                name: "key",
                byte: b'"',
            },
        ),
        (
            config("a:b", "é"),
            Fault::Sign {
                name: "value",
                byte: 0xc3,
            },
        ),
        (
            other("LED", &["1,2"]),
            Fault::Sign {
                name: "argument",
                byte: b',',
            },
        ),
        (
            other("LED", &["\"1"]),
            Fault::Sign {
                name: "argument",
                byte: b'"',
            },
        ),
        (other("PCMD", &["1"]), Fault::Name("PCMD".to_owned())),
        (other("", &[]), Fault::Name(String::new())),
        (other("led", &[]), Fault::Name("led".to_owned())),
        (
            config("a:b", &"c".repeat(1024)),
            Fault::Long {
                length: 1045,
                limit: 1024,
            },
        ),
    ] {
        assert_eq!(at::write(&[command], 1).unwrap_err().fault, fault);
    }
    assert!(at::write(&vec![Command::Watchdog; 79], 1).is_ok_and(|text| text.len() <= 1024));
    assert!(at::write(&vec![Command::Watchdog; 80], 1).is_err());
    assert!(at::write(&[Command::Watchdog, Command::Watchdog], i32::MAX as u32).is_err());
}

#[test]
fn a_real_bootstrap_packet_is_read_and_written() {
    let packet = navdata::read(&BOOTSTRAP, true).unwrap();
    assert_eq!(packet.head.state, 0x4f80_0c10);
    assert_eq!((packet.head.sequence, packet.head.vision), (1, 0));
    assert_eq!(
        navdata::write(&packet.head, &packet.options).unwrap(),
        BOOTSTRAP
    );
}

#[test]
fn packets_have_the_sizes_of_the_drone() {
    assert_eq!(full().len(), 2190);
    assert_eq!(common::demo().len(), 500);
    assert_eq!(&full()[..4], b"\x88\x77\x66\x55");
}

#[test]
fn fields_are_where_the_drone_has_them() {
    let packet = full();
    let i32_at = |at: usize| i32::from_le_bytes(packet[at..at + 4].try_into().unwrap());
    let f32_at = |at: usize| f32::from_le_bytes(packet[at..at + 4].try_into().unwrap());
    // The first option begins at 16, and offsets count from its tag.
    assert_eq!(i32_at(16 + 4), 3 << 16);
    assert_eq!(i32_at(16 + 8), 68);
    assert_eq!(i32_at(16 + 24), 1104);
    assert!((f64::from(f32_at(16 + 12)) - (-20.0f64).to_degrees()).abs() < 1e-3);
    // The vertical speed that is followed, in mm/s, up positive.
    let pwm = packet
        .windows(4)
        .position(|four| four == [9, 0, 92, 0])
        .unwrap();
    assert!((f32_at(pwm + 24) + 50.0).abs() < 1e-4);
    let read = navdata::read(&packet, true).unwrap();
    assert_eq!(read.option::<Demo>().unwrap().height, 1.104);
    assert!((read.option::<KalmanPressure>().unwrap().est_zdot - 0.24).abs() < 1e-6);
}

/// The body of one option in a packet of its own.
fn alone(tag: u16, bytes: &[u8]) -> Vec<u8> {
    navdata::write(&Head::default(), &[OptionView { tag, bytes }]).unwrap()
}

#[test]
fn options_may_be_longer_shorter_or_unknown() {
    for (length, there) in [(23, false), (24, true), (72, true), (88, true), (400, true)] {
        let packet = alone(9, &vec![0; length]);
        let read = navdata::read(&packet, true).unwrap();
        assert_eq!(read.option::<Pwm>().is_some(), there, "{length}");
        assert_eq!(read.options.len(), 1);
    }
    let packet = alone(77, b"whatever");
    let read = navdata::read(&packet, true).unwrap();
    assert_eq!(
        read.options,
        [OptionView {
            tag: 77,
            bytes: b"whatever"
        }]
    );
    assert!(read.options[0].values().is_none());
}

#[test]
fn a_height_below_zero_is_one() {
    let mut body = vec![0; 144];
    let height = -3.847;
    Demo {
        height,
        ..Demo::default()
    }
    .write(&mut body)
    .unwrap();
    let packet = alone(0, &body);
    let read = navdata::read(&packet, true).unwrap();
    assert_eq!(read.option::<Demo>().unwrap().height, height);
}

#[test]
fn the_clock_has_seconds_and_microseconds() {
    for (time, word) in [
        (680.634_46, (680u32 << 21) | 634_460),
        (0.0, 0),
        (2_047.999_999, (2047 << 21) | 999_999),
        (2049.5, (1 << 21) | 500_000),
        (2_047.999_999_7, 0),
    ] {
        let mut body = vec![0; 4];
        Clock { time }.write(&mut body).unwrap();
        assert_eq!(body, word.to_le_bytes(), "{time}");
    }
    // More than a million microseconds: read as they are, and left as they are.
    let body = ((5u32 << 21) | 1_200_000).to_le_bytes();
    let clock = Clock::read(&body).unwrap();
    assert_eq!(clock.time, 6.2);
    let mut again = body;
    clock.write(&mut again).unwrap();
    assert_eq!(again, body);
}

#[test]
fn packets_with_wrong_sizes_are_refused_where_they_are_wrong() {
    let good = alone(9, &[0; 88]);
    let with = |at: usize, bytes: &[u8]| {
        let mut packet = good.clone();
        packet[at..at + bytes.len()].copy_from_slice(bytes);
        navdata::read(&packet, false).map(|_| ()).unwrap_err()
    };
    for size in [0u8, 1, 2, 3] {
        let error = with(18, &[size, 0]);
        let (tag, size, left) = (9, usize::from(size), 100);
        assert_eq!(error.fault, Fault::OptionSize { tag, size, left });
        assert_eq!(error.offset, 16);
    }
    assert!(matches!(
        with(18, &[0xff, 0xff]).fault,
        Fault::OptionSize { size: 65_535, .. }
    ));
    assert!(matches!(
        with(18, &[96, 0]).fault,
        Fault::OptionSize { size: 0, .. }
    ));
    assert_eq!(with(18, &[100, 0]).fault, Fault::NoChecksum);
    assert!(matches!(
        with(110, &[12, 0]).fault,
        Fault::OptionSize { .. }
    ));
    assert_eq!(with(110, &[4, 0]).fault, Fault::NoChecksum);
    assert!(matches!(with(0, b"GET ").fault, Fault::Header(_)));
    let mut long = good.clone();
    long.push(0);
    assert_eq!(
        navdata::read(&long, true).unwrap_err().fault,
        Fault::NoChecksum
    );
    for length in 0..good.len() {
        assert!(navdata::read(&good[..length], false).is_err(), "{length}");
    }
}

#[test]
fn a_wrong_checksum_is_refused_or_told() {
    let mut packet = full();
    packet[100] ^= 1;
    let error = navdata::read(&packet, true).unwrap_err();
    assert!(matches!(error.fault, Fault::Checksum { .. }));
    assert_eq!(error.offset, 2186);
    assert!(!navdata::read(&packet, false).unwrap().checksum_matches);
}

#[test]
fn values_without_a_place_on_the_wire_are_refused() {
    for height in [f64::NAN, f64::INFINITY, 3e6] {
        let demo = Demo {
            height,
            ..Demo::default()
        };
        assert!(demo.write(&mut [0; 144]).is_err());
    }
    for vx in [f64::NAN, f64::NEG_INFINITY, 1e300] {
        assert!(
            Demo {
                vx,
                ..Demo::default()
            }
            .write(&mut [0; 144])
            .is_err()
        );
    }
    assert!(Demo::default().write(&mut [0; 39]).is_err());
    assert!(Clock { time: -1.0 }.write(&mut [0; 4]).is_err());
    let checksum = OptionView {
        tag: 0xffff,
        bytes: &[],
    };
    assert!(navdata::write(&Head::default(), &[checksum]).is_err());
    let long = OptionView {
        tag: 1,
        bytes: &[0; 8165],
    };
    assert!(navdata::write(&Head::default(), &[long]).is_err());
    assert!(
        navdata::write(
            &Head {
                header: 0,
                ..Head::default()
            },
            &[]
        )
        .is_err()
    );
}

#[test]
fn a_configuration_is_lines_and_a_nul() {
    let read = |text: &'static str| configuration::read(text.as_bytes());
    assert_eq!(read("\0").unwrap(), []);
    assert_eq!(
        read("a:b = c\r\n\n a:d =\ne:f = x = { 1 2 }\na:b = c\n\0").unwrap(),
        [("a:b", "c"), ("a:d", ""), ("e:f", "x = { 1 2 }")]
    );
    for (text, fault, offset) in [
        ("a:b = c\n", Fault::NoEnd, 8),
        ("a:b = c\n\0\0", Fault::AfterEnd, 9),
        ("a:b = c\nnonsense\n\0", Fault::Line, 8),
        ("ab = c\n\0", Fault::Line, 0),
        (":b = c\n\0", Fault::Line, 0),
        ("a: = c\n\0", Fault::Line, 0),
        ("a b:c = d\n\0", Fault::Line, 0),
        ("a:b = c\u{1b}[2J\n\0", Fault::Line, 0),
        ("a:b = 1\na:b = 2\n\0", Fault::Twice("a:b".to_owned()), 8),
    ] {
        let error = read(text).unwrap_err();
        assert_eq!((error.fault, error.offset), (fault, offset), "{text:?}");
    }
    let error = configuration::read(b"a:b = \xff\n\0").unwrap_err();
    assert_eq!((error.fault, error.offset), (Fault::Text, 6));
    assert!(configuration::read(&vec![0; 16_385]).is_err());
}

#[test]
fn a_configuration_that_would_not_be_read_is_not_written() {
    for setting in [
        ("ab", "c"),
        ("a:b", " c"),
        ("a:b", "c\n"),
        ("a:b=", "c"),
        ("a:b", "c\0"),
    ] {
        assert!(configuration::write(&[setting]).is_err(), "{setting:?}");
    }
    assert!(configuration::write(&[("a:b", "1"), ("a:b", "2")]).is_err());
}

#[test]
fn packets_of_a_loop_hold_finite_numbers() {
    let good = common::loop_corpus().remove(1);
    assert_eq!(good.len(), loop_packet::LENGTH);
    assert!(loop_packet::read(&good).is_ok());
    for at in [16, 24, 32, 40, 48] {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut packet = good.clone();
            packet[at..at + 8].copy_from_slice(&bad.to_le_bytes());
            let error = loop_packet::read(&packet).unwrap_err();
            assert!(matches!(error.fault, Fault::NotFinite { .. }));
            assert_eq!(error.offset, at);
        }
    }
    let mut packet = good.clone();
    packet[32..40].copy_from_slice(&(-1e-9f64).to_le_bytes());
    assert!(matches!(
        loop_packet::read(&packet).unwrap_err().fault,
        Fault::Range { .. }
    ));
    let mut packet = good.clone();
    packet[3] = b'2';
    assert!(matches!(
        loop_packet::read(&packet).unwrap_err().fault,
        Fault::Header(_)
    ));
    for length in (0..good.len()).chain([57, 500]) {
        let packet: Vec<u8> = good.iter().copied().cycle().take(length).collect();
        assert!(loop_packet::read(&packet).is_err());
    }
}

#[test]
fn bare_doubles_are_counted() {
    let bytes = loop_packet::write_doubles(&[1.0, -2.5]).unwrap();
    assert_eq!(bytes[..8], [0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
    assert_eq!(loop_packet::read_doubles(&bytes, 2).unwrap(), [1.0, -2.5]);
    for count in [0, 1, 3, usize::MAX] {
        assert!(loop_packet::read_doubles(&bytes, count).is_err());
    }
    assert!(loop_packet::read_doubles(&bytes[..15], 1).is_err());
    assert!(loop_packet::read_doubles(&f64::NAN.to_le_bytes(), 1).is_err());
    assert!(loop_packet::write_doubles(&[f64::INFINITY]).is_err());
}
