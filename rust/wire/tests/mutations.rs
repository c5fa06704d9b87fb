//! A seeded fuzzer of every reader: packets that the crate has written, damaged in every way that
//! comes to mind. No reader may panic or do more work than the bytes there are; what one lets
//! through must be writable, and be the same again.
//!
//! A quarter of a million packets for each reader; `DEADTIME_MUTATIONS=1000000 cargo test --release
//! -p deadtime-wire --test mutations -- --nocapture` for more, with the longest time of a call.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

mod common;

use common::checks;
use deadtime_wire::{at, blackbox, configuration, loop_packet, navdata};
use std::time::{Duration, Instant};

/// Random numbers after Marsaglia's xorshift (2003), with a multiplier against its linearity.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Below `bound`, 0 when that is 0.
    fn below(&mut self, bound: usize) -> usize {
        ((self.next() >> 33) as usize)
            .checked_rem(bound)
            .unwrap_or(0)
    }
}

/// Bytes with a meaning for one of the readers.
const TELLING: &[u8] = b"\x00\x01\x03\x04\x08\x7f\x80\xff\r\n\",=*:- 09";
/// Words with a meaning for one of the readers.
const WORDS: &[&[u8]] = &[
    b"AT*PCMD=1,1,0,0,2139095040,0\r",
    b"AT*REF=1,",
    b"\r\nAT*",
    b"2143289344",
    b"-2147483648",
    b"99999999999999999999",
    b"\"\"",
    b"\xff\xff\x08\x00",
    b"\x00\x00\x00\x00",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\xc0\x7f",
    b"\x00\x00\x00\x00\x00\x00\xf8\x7f",
    b"\x88\x77\x66\x55",
    b"a:b = c\n",
    b"\xc3\xa9",
    b"E\xffEnd of log\0",
    b"P\x04\0\0\0\0",
    b"S\x03\0\x05",
];

fn damage(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Random) {
    for _ in 0..=random.below(4) {
        let (at, length) = (random.below(bytes.len()), bytes.len());
        match random.below(10) {
            0 if length > 0 => bytes[at] ^= 1 << random.below(8),
            1 if length > 0 => bytes[at] = random.next() as u8,
            2 if length > 0 => bytes[at] = TELLING[random.below(TELLING.len())],
            3 => bytes.truncate(at),
            4 => bytes.extend((0..random.below(40)).map(|_| random.next() as u8)),
            5 => {
                let piece = bytes[at..at + random.below(length - at)].to_vec();
                let place = random.below(bytes.len());
                bytes.splice(place..place, piece);
            }
            6 => {
                bytes.drain(at..at + random.below(length - at));
            }
            7 => {
                let word = WORDS[random.below(WORDS.len())];
                let end = (at + random.below(word.len() + 1)).min(length);
                bytes.splice(at..end, word.iter().copied());
            }
            8 => {
                let other = &others[random.below(others.len())];
                let from = random.below(other.len());
                bytes.splice(at.., other[from..].iter().copied());
            }
            // A wrong size, where options have theirs.
            _ if length > 20 => {
                let at = 16 + 2 * random.below((length - 18) / 2);
                let size = random.next() as u16 >> random.below(16);
                bytes[at..at + 2].copy_from_slice(&size.to_le_bytes());
            }
            _ => {}
        }
    }
    bytes.truncate(20_000);
}

/// Corrects the checksum; otherwise few damaged packets would be read to their end.
fn repair(packet: &mut [u8]) {
    if let Some(end) = packet.len().checked_sub(8) {
        let sum: u32 = packet[..end].iter().map(|&byte| u32::from(byte)).sum();
        packet[end..end + 4].copy_from_slice(&[0xff, 0xff, 8, 0]);
        packet[end + 4..].copy_from_slice(&sum.to_le_bytes());
    }
}

fn wanted() -> usize {
    let asked = std::env::var("DEADTIME_MUTATIONS").ok();
    asked.and_then(|text| text.parse().ok()).unwrap_or(250_000)
}

/// Reads damaged packets; `check` has to hold for each, whether it is accepted or not.
fn survey<T>(
    name: &str,
    corpus: &[Vec<u8>],
    mend: fn(&mut [u8]),
    read: impl Fn(&[u8]) -> T,
    check: fn(&[u8]) -> bool,
) {
    let time_of = |bytes: &[u8]| {
        let start = Instant::now();
        drop(std::hint::black_box(read(bytes)));
        start.elapsed()
    };
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut longest, mut size, mut taken) = (Duration::ZERO, 0, 0);
    for _ in 0..wanted() {
        let mut bytes = corpus[random.below(corpus.len())].clone();
        damage(&mut bytes, corpus, &mut random);
        if random.below(2) == 0 {
            mend(&mut bytes);
        }
        taken += usize::from(check(&bytes));
        let time = time_of(&bytes);
        if time > longest {
            // The time is measured a few times, because the machine may have been busy.
            let time = (0..9).fold(time, |least, _| least.min(time_of(&bytes)));
            if time > longest {
                (longest, size) = (time, bytes.len());
            }
        }
    }
    let all = wanted();
    println!("{name}: {taken} of {all} damaged packets taken, longest {longest:?} ({size} bytes)");
    // A survey that accepts nothing, or everything, tests little.
    assert!(taken > all / 100 && taken < all, "{name}: {taken} of {all}");
}

#[test]
fn navdata_are_read_or_refused() {
    let corpus = common::navdata_corpus();
    let read = |bytes: &[u8]| {
        navdata::read(bytes, false).map_or(0, |packet| {
            let values = packet.options.iter().filter_map(|option| option.values());
            values.count()
        })
    };
    survey("navdata", &corpus, repair, read, checks::navdata);
}

#[test]
fn commands_are_read_or_left_out() {
    survey(
        "commands",
        &common::at_corpus(),
        |_| (),
        at::read,
        checks::commands,
    );
}

#[test]
fn configurations_are_read_or_refused() {
    let read = |bytes: &[u8]| configuration::read(bytes).is_ok();
    let corpus = common::configuration_corpus();
    survey(
        "configuration",
        &corpus,
        |_| (),
        read,
        checks::configuration,
    );
}

#[test]
fn packets_of_a_loop_are_read_or_refused() {
    let corpus = common::loop_corpus();
    survey(
        "packets of a loop",
        &corpus,
        |_| (),
        loop_packet::read,
        checks::loop_packets,
    );
}

#[test]
fn flight_logs_are_read_as_far_as_they_are_whole() {
    let layout = checks::blackbox_layout();
    let read = |bytes: &[u8]| blackbox::read(bytes, &layout, usize::MAX);
    let corpus = common::blackbox_corpus();
    survey("flight logs", &corpus, |_| (), read, checks::blackbox);
}
