//! What has to hold of any bytes, for each reader: tests and fuzzers call these.
//!
//! A reader takes the bytes or does not, and each function says which. It does no more work than
//! the bytes there are, and what it lets through is written the same again.

#![allow(dead_code, clippy::unwrap_used, clippy::indexing_slicing)]

use deadtime_wire::at::{self, Command};
use deadtime_wire::blackbox::{self, Fields, Layout};
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

/// Fields of every encoding and predictor.
pub(crate) fn blackbox_layout() -> Layout {
    let fields = |encodings: &[u8], predictors: &[u8]| Fields::new(encodings, predictors).unwrap();
    Layout {
        intra: fields(
            &[1, 1, 0, 3, 1, 0, 0, 0, 0, 8, 8, 8, 8, 10, 10, 10],
            &[0, 0, 4, 9, 11, 5, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        ),
        inter: Some(fields(
            &[9, 0, 8, 8, 8, 8, 7, 7, 7, 6, 6, 6, 6, 10, 10, 10],
            &[6, 2, 1, 1, 3, 3, 3, 1, 1, 1, 1, 1, 1, 2, 3, 5],
        )),
        slow: Some(fields(&[1, 1, 7, 7, 7], &[0; 5])),
        gps: Some(fields(&[1, 0, 0, 1], &[10, 7, 7, 0])),
        home: Some(fields(&[0, 0], &[0, 0])),
        iteration: 0,
        time: 1,
        first_motor: Some(4),
        least_throttle: 1070,
        least_motor: 158,
        voltage: 1650,
        interval: 8,
        logged: (1, 2),
    }
}

pub(crate) fn blackbox(bytes: &[u8]) -> bool {
    let layout = blackbox_layout();
    let frames = blackbox::read(bytes, &layout, usize::MAX).unwrap();
    let tables = [
        (&frames.main, 16),
        (&frames.slow, layout.slow.as_ref().unwrap().count()),
        (&frames.gps, layout.gps.as_ref().unwrap().count()),
    ];
    let mut held = 0;
    for (table, fields) in tables {
        assert_eq!(table.values.len(), table.rows * fields);
        held += table.values.len() + table.rows;
    }
    assert_eq!(frames.slow.before.len(), frames.slow.rows);
    assert!(frames.gps.before.is_sorted() && frames.slow.before.is_sorted());
    // A frame has its letter and a byte at least.
    let rows = frames.main.rows + frames.slow.rows + frames.gps.rows;
    assert!(2 * rows <= bytes.len() && frames.damaged as usize <= bytes.len());
    assert!(blackbox::read(bytes, &layout, held).is_ok());
    assert!(held == 0 || blackbox::read(bytes, &layout, held - 1).is_err());
    frames.main.rows > 0
}
