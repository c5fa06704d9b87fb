//! Writes packets for the fuzzers to start from, one folder for each of them:
//! `cargo run -p deadtime-wire --example fuzz_seeds rust/fuzz/corpus`.

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(
        std::env::args()
            .nth(1)
            .unwrap_or_else(|| "corpus".to_owned()),
    );
    for (target, packets) in [
        ("navdata", common::navdata_corpus()),
        ("at_commands", common::at_corpus()),
        ("configuration", common::configuration_corpus()),
        ("loop_packet", common::loop_corpus()),
        ("blackbox", common::blackbox_corpus()),
    ] {
        std::fs::create_dir_all(folder.join(target))?;
        for (number, packet) in packets.iter().enumerate() {
            std::fs::write(folder.join(target).join(format!("seed{number}")), packet)?;
        }
    }
    Ok(())
}
