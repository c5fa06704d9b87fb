#![no_main]

#[path = "../../wire/tests/common/checks.rs"]
mod checks;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    checks::blackbox(bytes);
});
