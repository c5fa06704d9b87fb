//! Configurations, packets of a loop and bare doubles.

#![allow(clippy::unwrap_used)]

mod common;

use deadtime_wire::{Fault, configuration, loop_packet};

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
    let error = loop_packet::read(&packet).unwrap_err();
    assert!(matches!(error.fault, Fault::Range { .. }));
    let mut packet = good.clone();
    packet[3] = b'2';
    let error = loop_packet::read(&packet).unwrap_err();
    assert!(matches!(error.fault, Fault::Header(_)));
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
