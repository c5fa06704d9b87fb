//! Wire formats: one packet of each kind, read and written.
//!
//! `cargo bench --bench wire`; a full packet of navdata has 2190 bytes, a short one 500.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use deadtime_wire::at::{self, Command};
use deadtime_wire::loop_packet::{self, LoopPacket};
use deadtime_wire::navdata::{self, Demo, FULL, Head, KalmanPressure, Known, OptionView, Pwm};
use deadtime_wire::{Unit, configuration};

/// A packet with the options of these tags.
fn packet(tags: impl Fn(u16) -> bool) -> Vec<u8> {
    let zeros = [0; 400];
    let options: Vec<OptionView<'_>> = FULL
        .iter()
        .filter(|(tag, _)| tags(*tag))
        .filter_map(|&(tag, size)| zeros.get(4..size).map(|bytes| OptionView { tag, bytes }))
        .collect();
    navdata::write(&Head::default(), &options).unwrap_or_default()
}

fn wire(c: &mut Criterion) {
    for (name, bytes) in [
        ("full", packet(|_| true)),
        ("short", packet(|tag| tag == 0 || tag == 16)),
    ] {
        c.bench_function(&format!("navdata/{name}/read"), |b| {
            b.iter(|| navdata::read(black_box(&bytes), true).map(|packet| packet.options.len()));
        });
        c.bench_function(&format!("navdata/{name}/read, climb and height"), |b| {
            b.iter(|| {
                let packet = navdata::read(black_box(&bytes), true)?;
                let demanded = packet.option::<Pwm>().map(|pwm| pwm.vz_ref);
                let climb = packet
                    .option::<KalmanPressure>()
                    .map(|found| found.est_zdot);
                let height = packet.option::<Demo>().map(|demo| demo.height);
                Ok::<_, deadtime_wire::Error>((height, climb, demanded))
            });
        });
        let Ok(read) = navdata::read(&bytes, true) else {
            continue;
        };
        c.bench_function(&format!("navdata/{name}/every field"), |b| {
            b.iter(|| {
                black_box(&read)
                    .options
                    .iter()
                    .filter_map(|o| o.values())
                    .count()
            });
        });
        c.bench_function(&format!("navdata/{name}/write"), |b| {
            b.iter(|| navdata::write(black_box(&read.head), &read.options));
        });
    }
    c.bench_function("navdata/demo fields/write", |b| {
        let demo = Demo {
            height: 1.25,
            pitch: -0.02,
            ..Demo::default()
        };
        let mut body = [0; 144];
        b.iter(|| black_box(&demo).write(&mut body));
    });

    let motion = Command::Move {
        flag: 1,
        roll: Unit::ZERO,
        pitch: Unit::ZERO,
        gaz: Unit::from_bits(0x3f00_0000).unwrap_or_default(),
        yaw: Unit::ZERO,
    };
    let flying = Command::Ref {
        take_off: true,
        emergency: false,
    };
    let commands = [flying, motion];
    let datagram = at::write(&commands, 1).unwrap_or_default();
    c.bench_function("commands/REF and PCMD/write", |b| {
        b.iter(|| at::write(black_box(&commands), 1));
    });
    c.bench_function("commands/REF and PCMD/read", |b| {
        b.iter(|| at::read(black_box(&datagram)));
    });

    let keys: Vec<String> = (0..120).map(|key| format!("section:key_{key}")).collect();
    let settings: Vec<(&str, &str)> = keys.iter().map(|key| (key.as_str(), "value")).collect();
    let dump = configuration::write(&settings).unwrap_or_default();
    c.bench_function("configuration of 120 lines/read", |b| {
        b.iter(|| configuration::read(black_box(&dump)).map(|settings| settings.len()));
    });

    let answer = LoopPacket {
        sequence: 1,
        value: 0.5,
        ..LoopPacket::default()
    };
    let bytes = loop_packet::write(&answer).unwrap_or_default();
    c.bench_function("packet of a loop/write", |b| {
        b.iter(|| loop_packet::write(black_box(&answer)))
    });
    c.bench_function("packet of a loop/read", |b| {
        b.iter(|| loop_packet::read(black_box(&bytes)))
    });
}

criterion_group!(benches, wire);
criterion_main!(benches);
