//! What has to hold of any bytes, for each reader: tests and fuzzers call these.
//!
//! A reader takes the bytes or does not, and each function says which. It does no more work than
//! the bytes there are, and what it lets through is written the same again.

#![allow(dead_code, clippy::unwrap_used, clippy::indexing_slicing)]

use deadtime_wire::at::{self, Command};
use deadtime_wire::{configuration, loop_packet, navdata};

pub(crate) fn navdata(bytes: &[u8]) -> bool {
    let Ok(packet) = navdata::read(bytes, false) else {
        assert!(navdata::read(bytes, true).is_err());
        return false;
    };
    assert_eq!(navdata::read(bytes, true).is_ok(), packet.checksum_matches);
    // Every option has a head of its own among the bytes.
    let held: usize = packet
        .options
        .iter()
        .map(|option| option.bytes.len() + 4)
        .sum();
    assert_eq!(held + 24, bytes.len());
    for option in &packet.options {
        if let (Some(layout), Some(values)) = (option.layout(), option.values()) {
            let mut again = option.bytes.to_vec();
            layout.write(&mut again, &values).unwrap();
            assert_eq!(again, option.bytes);
        }
    }
    let again = navdata::write(&packet.head, &packet.options).unwrap();
    let end = bytes.len() - 4;
    assert_eq!(again[..end], bytes[..end]);
    assert_eq!(again == bytes, packet.checksum_matches);
    true
}

pub(crate) fn commands(bytes: &[u8]) -> bool {
    let read = at::read(bytes);
    // The shortest possible command: AT*X=0 and its end.
    assert!(read.len() * 7 <= bytes.len().min(at::LIMIT));
    for (sequence, command) in &read {
        if let Command::Move {
            roll,
            pitch,
            gaz,
            yaw,
            ..
        } = command
        {
            assert!(
                [roll, pitch, gaz, yaw]
                    .iter()
                    .all(|unit| unit.get().abs() <= 1.0)
            );
        }
        // Only base bits and arguments written in full can make it longer than it was.
        match at::write(std::slice::from_ref(command), *sequence) {
            Ok(line) => assert_eq!(at::read(&line), [(*sequence, command.clone())]),
            Err(_) => assert!(bytes.len() > at::LIMIT - 64),
        }
    }
    !read.is_empty()
}

pub(crate) fn configuration(bytes: &[u8]) -> bool {
    let Ok(settings) = configuration::read(bytes) else {
        return false;
    };
    let held: usize = settings
        .iter()
        .map(|(key, value)| key.len() + value.len() + 1)
        .sum();
    assert!(held <= bytes.len());
    // Only spaces around the equals sign can make it longer than it was.
    match configuration::write(&settings) {
        Ok(dump) => assert_eq!(configuration::read(&dump).unwrap(), settings),
        Err(_) => assert!(bytes.len() + 3 * settings.len() > configuration::LIMIT),
    }
    true
}

pub(crate) fn loop_packets(bytes: &[u8]) -> bool {
    if let Ok(values) = loop_packet::read_doubles(bytes, bytes.len() / 8) {
        assert_eq!(loop_packet::write_doubles(&values).unwrap(), bytes);
    }
    match loop_packet::read(bytes) {
        Ok(packet) => {
            assert_eq!(loop_packet::write(&packet).unwrap(), bytes);
            true
        }
        Err(_) => false,
    }
}
