//! Wire formats: one packet of each kind, read and written; tables in text.
//!
//! `cargo bench --bench wire`; a full packet of navdata has 2190 bytes, a short one 500. The limit of
//! a table is one pass over its bytes, which counts its separators.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use deadtime_wire::at::{self, Command};
use deadtime_wire::csv::{self, Fault, Layout};
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

/// A table of 100 000 rows without its header: a time, two numbers and a whole one.
fn table(row: impl Fn(f64, f64) -> String) -> Vec<u8> {
    let rows = (0..100_000).map(|k| {
        let time = f64::from(k) * 1e-3;
        row(time, (time * 1.7).sin() * 3.0)
    });
    rows.collect::<String>().into_bytes()
}

fn tables(c: &mut Criterion) {
    let layout = Layout {
        delimiter: b',',
        width: 4,
        columns: ["t", "r", "y", "u"]
            .map(str::to_owned)
            .into_iter()
            .enumerate()
            .collect(),
        window: (f64::NEG_INFINITY, f64::INFINITY),
        line: 2,
    };
    let mut group = c.benchmark_group("table");
    for (name, bytes) in [
        (
            "six decimals",
            table(|t, y| format!("{t:.3},1,{y:.6},{:.6}\n", y / 7.0)),
        ),
        (
            "all digits",
            table(|t, y| format!("{t:.3},1,{y},{}\n", y / 7.0)),
        ),
        (
            "quoted",
            table(|t, y| format!("\"{t:.3}\",\"1\",\"{y:.6}\",\"{:.6}\"\n", y / 7.0)),
        ),
    ] {
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(format!("{name}/read"), |b| {
            b.iter(|| csv::read::<Fault>(black_box(&bytes), &layout, || Ok(())));
        });
        group.bench_function(format!("{name}/one pass"), |b| {
            b.iter(|| memchr::memchr_iter(b',', black_box(&bytes)).count());
        });
    }
    group.finish();
}

criterion_group!(benches, wire, tables);
criterion_main!(benches);
