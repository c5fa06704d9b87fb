//! What was written is read again, and what was read is written again, for any values and bytes.

#![allow(clippy::unwrap_used)]

use deadtime_wire::at::{self, Command};
use deadtime_wire::loop_packet::{self, LoopPacket};
use deadtime_wire::navdata::{self, Demo, Head, Known, LAYOUTS, OptionView};
use deadtime_wire::{Unit, configuration};
use proptest::collection::vec;
use proptest::prelude::*;

fn units() -> impl Strategy<Value = Unit> {
    (-1.0..=1.0).prop_map(|value: f64| Unit::new(value).unwrap())
}

fn texts() -> impl Strategy<Value = String> {
    "[ !#-~]{0,30}"
}

fn commands() -> impl Strategy<Value = Command> {
    let motion = || (any::<i32>(), units(), units(), units(), units());
    let headings = (motion(), units(), units());
    prop_oneof![
        (any::<bool>(), any::<bool>()).prop_map(|(take_off, emergency)| Command::Ref {
            take_off,
            emergency
        }),
        motion().prop_map(|(flag, roll, pitch, gaz, yaw)| Command::Move {
            flag,
            roll,
            pitch,
            gaz,
            yaw
        }),
        headings.prop_map(|((flag, roll, pitch, gaz, yaw), heading, accuracy)| {
            Command::MoveFrom {
                flag,
                roll,
                pitch,
                gaz,
                yaw,
                heading,
                accuracy,
            }
        }),
        (texts(), texts()).prop_map(|(key, value)| Command::Config { key, value }),
        (texts(), texts(), texts()).prop_map(|(session, user, application)| Command::ConfigIds {
            session,
            user,
            application
        }),
        any::<i32>().prop_map(|mode| Command::Control { mode }),
        any::<i32>().prop_map(|device| Command::Calibrate { device }),
        Just(Command::Watchdog),
        Just(Command::FlatTrim),
        (
            "X[A-Z0-9_]{0,8}",
            vec("[ !#-+\\--~]{0,9}|\"[ !#-~]{0,9}\"", 0..4)
        )
            .prop_map(|(name, arguments)| Command::Other { name, arguments }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn commands_survive(commands in vec(commands(), 0..5), first in 0u32..=i32::MAX as u32 - 5) {
        let written = at::write(&commands, first).unwrap();
        let read = at::read(&written);
        prop_assert_eq!(read, (first..).zip(commands).collect::<Vec<_>>());
    }

    #[test]
    fn any_number_becomes_a_unit_or_is_refused(bits in any::<u64>()) {
        let value = f64::from_bits(bits);
        match Unit::new(value) {
            Ok(unit) => {
                prop_assert!((-1.0..=1.0).contains(&value));
                prop_assert!((unit.get() - value).abs() <= f64::from(f32::EPSILON));
            }
            Err(_) => prop_assert!(!(-1.0..=1.0).contains(&value)),
        }
    }

    #[test]
    fn any_bytes_of_commands_are_read_as_units(token in any::<u32>()) {
        let line = format!("AT*PCMD=1,1,0,0,{},0\r", token as i32);
        for (_, command) in at::read(line.as_bytes()) {
            let Command::Move { gaz, .. } = command else { panic!("{command:?}") };
            prop_assert!((-1.0..=1.0).contains(&gaz.get()));
            prop_assert!(f32::from_bits(token).is_finite());
        }
    }

    #[test]
    fn navdata_survive(
        state in any::<u32>(),
        sequence in any::<u32>(),
        vision in any::<u32>(),
        other in any::<bool>(),
        bodies in vec((0u16..40, vec(any::<u8>(), 0..400)), 0..8),
    ) {
        let header = if other { 0x5566_7789 } else { 0x5566_7788 };
        let head = Head { header, state, sequence, vision };
        let options: Vec<OptionView<'_>> =
            bodies.iter().map(|(tag, bytes)| OptionView { tag: *tag, bytes }).collect();
        let packet = navdata::write(&head, &options).unwrap();
        let read = navdata::read(&packet, true).unwrap();
        prop_assert_eq!(read.head, head);
        prop_assert_eq!(&read.options, &options);
        // Fields written over the bytes they were read from leave them as they are, NaN included.
        for option in &read.options {
            let (Some(layout), Some(values)) = (option.layout(), option.values()) else { continue };
            let mut bytes = option.bytes.to_vec();
            layout.write(&mut bytes, &values).unwrap();
            prop_assert_eq!(bytes, option.bytes, "{}", layout.name);
        }
    }

    #[test]
    fn fields_survive_on_any_bytes(
        under in vec(any::<u8>(), 144),
        battery in any::<u32>(),
        height in -2e6..2e6,
        pitch in -7.0..7.0,
        vx in -1e5..1e5,
    ) {
        let mut body = under;
        let demo = Demo { battery, height, pitch, vx, ..Demo::default() };
        demo.write(&mut body).unwrap();
        let read = Demo::read(&body).unwrap();
        prop_assert_eq!(read.battery, battery);
        prop_assert!((read.height - height).abs() <= 5.000_001e-4);
        prop_assert!((read.pitch - pitch).abs() <= 1e-7 * pitch.abs());
        prop_assert!((read.vx - vx).abs() <= 1e-7 * vx.abs());
        prop_assert_eq!((read.major, read.frame, read.yaw), (0, 0, 0.0));
    }

    #[test]
    fn configurations_survive(
        settings in vec(("[a-z]{1,8}:[a-z_]{1,12}", "([!-~α-ω]([ -~]{0,20}[!-~])?)?"), 0..20),
    ) {
        let mut distinct = settings.clone();
        distinct.sort();
        distinct.dedup_by(|a, b| a.0 == b.0);
        let borrowed: Vec<(&str, &str)> =
            distinct.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
        let dump = configuration::write(&borrowed).unwrap();
        prop_assert_eq!(configuration::read(&dump).unwrap(), borrowed);
    }

    #[test]
    fn packets_of_a_loop_survive(
        words in any::<(u32, u32, u32)>(),
        numbers in (-1e300..1e300, -1e9..1e9, 0.0..1e3, -1e9..1e9, -1e9..1e9),
    ) {
        let (flags, sequence, echo_sequence) = words;
        let (sent, echo_sent, held, value, reference) = numbers;
        let packet = LoopPacket {
            flags, sequence, echo_sequence, sent, echo_sent, held, value, reference,
        };
        prop_assert_eq!(loop_packet::read(&loop_packet::write(&packet).unwrap()).unwrap(), packet);
    }

    #[test]
    fn doubles_survive(values in vec(-1e300..1e300, 0..20)) {
        let bytes = loop_packet::write_doubles(&values).unwrap();
        prop_assert_eq!(loop_packet::read_doubles(&bytes, values.len()).unwrap(), values);
    }
}

#[test]
fn fields_lie_inside_their_options() {
    for layout in LAYOUTS {
        let zeros = vec![0; layout.length];
        assert_eq!(
            layout.read(&zeros).unwrap().len(),
            layout.fields.len(),
            "{}",
            layout.name
        );
        let size = navdata::FULL
            .iter()
            .find(|(tag, _)| *tag == layout.tag)
            .unwrap()
            .1;
        assert_eq!(size, layout.length + 4, "{}", layout.name);
    }
}
