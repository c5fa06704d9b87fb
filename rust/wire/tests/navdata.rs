//! Navdata: the places of fields in a packet, permitted variations, and invalid packets.

#![allow(clippy::unwrap_used)]

mod common;

use common::{BOOTSTRAP, full};
use deadtime_wire::Fault;
use deadtime_wire::navdata::{self, Clock, Demo, Head, KalmanPressure, Known, OptionView, Pwm};

#[test]
fn a_real_bootstrap_packet_is_read_and_written() {
    let packet = navdata::read(&BOOTSTRAP, true).unwrap();
    assert_eq!(packet.head.state, 0x4f80_0c10);
    assert_eq!((packet.head.sequence, packet.head.vision), (1, 0));
    let again = navdata::write(&packet.head, &packet.options);
    assert_eq!(again.unwrap(), BOOTSTRAP);
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
    let (tag, bytes) = (77, b"whatever".as_slice());
    let packet = alone(tag, bytes);
    let read = navdata::read(&packet, true).unwrap();
    assert_eq!(read.options, [OptionView { tag, bytes }]);
    assert!(read.options[0].values().is_none());
}

fn demo(height: f64, vx: f64) -> Demo {
    Demo {
        height,
        vx,
        ..Demo::default()
    }
}

#[test]
fn a_height_below_zero_is_one() {
    let mut body = vec![0; 144];
    let height = -3.847;
    demo(height, 0.0).write(&mut body).unwrap();
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
    // More than a million microseconds: read and written unchanged.
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
    let size_of = |at, bytes| match with(at, bytes).fault {
        Fault::OptionSize { size, .. } => Some(size),
        _ => None,
    };
    assert_eq!(size_of(18, &[0xff, 0xff]), Some(65_535));
    assert_eq!(size_of(18, &[96, 0]), Some(0));
    assert!(size_of(110, &[12, 0]).is_some());
    assert_eq!(with(18, &[100, 0]).fault, Fault::NoChecksum);
    assert_eq!(with(110, &[4, 0]).fault, Fault::NoChecksum);
    assert!(matches!(with(0, b"GET ").fault, Fault::Header(_)));
    let mut long = good.clone();
    long.push(0);
    let error = navdata::read(&long, true).unwrap_err();
    assert_eq!(error.fault, Fault::NoChecksum);
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
        assert!(demo(height, 0.0).write(&mut [0; 144]).is_err());
    }
    for vx in [f64::NAN, f64::NEG_INFINITY, 1e300] {
        assert!(demo(0.0, vx).write(&mut [0; 144]).is_err());
    }
    assert!(Demo::default().write(&mut [0; 39]).is_err());
    assert!(Clock { time: -1.0 }.write(&mut [0; 4]).is_err());
    for (tag, bytes) in [(0xffff, &[][..]), (1, &[0; 8165])] {
        let option = OptionView { tag, bytes };
        assert!(navdata::write(&Head::default(), &[option]).is_err());
    }
    let head = Head {
        header: 0,
        ..Head::default()
    };
    assert!(navdata::write(&head, &[]).is_err());
}
