//! Tables in text: numbers as std reads them, any bytes, and the faults with their lines.

use deadtime_wire::csv::{Columns, Fault, Layout, NoNumber, Number, number, read};
use proptest::prelude::*;

fn layout(delimiter: u8, names: &[&str]) -> Layout {
    Layout {
        delimiter,
        width: names.len(),
        columns: names
            .iter()
            .map(|&name| name.to_owned())
            .enumerate()
            .collect(),
        window: (f64::NEG_INFINITY, f64::INFINITY),
        line: 2,
    }
}

fn two(table: &str) -> Result<Columns, Fault> {
    read(table.as_bytes(), &layout(b',', &["t", "y"]), || Ok(()))
}

#[test]
fn marks_are_told() {
    assert_eq!(number(b" -12\t"), Ok(Number::Whole(-12.0)));
    assert_eq!(number(b"-0.0"), Ok(Number::Point(-0.0)));
    assert_eq!(number(b"0,25"), Ok(Number::Comma(0.25)));
    assert_eq!(number(b"12,345"), Ok(Number::CommaOrThousand(12.345)));
    assert_eq!(number("7.5\u{a0}".as_bytes()), Ok(Number::Point(7.5)));
    assert_eq!(number(b"7.5\xa0"), Ok(Number::Point(7.5)));
    for cell in ["1,", ",", "1,2,3", "1.5,2", "1,e3", "x,5", "1,-5"] {
        assert_eq!(number(cell.as_bytes()), Err(NoNumber::Commas), "{cell}");
    }
    for cell in [
        "", " ", ".", "-", "1_0", "0x1", "1 2", "e5", "1d2", "--1", "\u{661}",
    ] {
        assert_eq!(number(cell.as_bytes()), Err(NoNumber::Other), "{cell}");
    }
}

#[test]
fn faults_name_the_line() {
    for (table, told) in [
        (
            "0,1\n\n# x\n1,a\n",
            "line 5: 'a' in column 'y' is not a number",
        ),
        (
            "0,1\r1,2,3\r",
            "line 3 has 3 cells, but there are 2 column names. If commas are decimal \
          marks, write points, or separate the columns by semicolons",
        ),
        (
            "0,1\r\n1\r\n",
            "line 3 has 1 cells, so the cell of the column 'y' is missing",
        ),
        (
            "0,\"a\nb\"\n",
            "line 3: 'a\\nb' in column 'y' is not a number",
        ),
        (
            "0,\"1\n",
            "line 2: this is not a CSV file: a quoted cell has no end",
        ),
        (
            "0,\"1\"2\n",
            "line 2: this is not a CSV file: a cell continues after its closing quote",
        ),
        (
            "0,\"1,5\"\n1,1.5\n",
            "line 3: '1.5' in column 'y' has a decimal point, but line 2 has the \
          other mark: write a decimal point in all cells",
        ),
        (
            "0,\"1,500\"\n",
            "line 2: '1,500' in column 'y' may be 1.5 or 1500, and no other cell \
          shows which: write a decimal point, or no comma",
        ),
    ] {
        let found = two(table).map_err(|fault| fault.to_string());
        assert_eq!(found, Err(told.to_owned()), "{table}");
    }
}

#[test]
fn a_time_that_does_not_increase_ends_the_reading() {
    let found = two("0,1\n2,1\n1,1\nx").unwrap();
    let backward = found.backward.unwrap();
    assert_eq!(
        (backward.line, backward.before, backward.now),
        (4, 2.0, 1.0)
    );
}

#[test]
fn a_repeated_time_is_told_and_an_empty_cell_is_missing() {
    let found = two("0,1\n0,\n0, \n2,3").unwrap();
    let repeated = found.repeated.unwrap();
    assert_eq!(
        (repeated.line, repeated.before, repeated.now),
        (3, 0.0, 0.0)
    );
    assert_eq!(found.values[0], [0.0, 0.0, 0.0, 2.0]);
    let missing: Vec<_> = found.values[1].iter().map(|value| value.is_nan()).collect();
    assert_eq!(missing, [false, true, true, false]);
    assert!(two(",1").is_err(), "a row without a time");
}

#[test]
fn dates_are_seconds_after_the_first() {
    let found = two("2024-02-28T23:59:59.75Z,1\n2024-02-29 01:00+01:00,2\n2024/03/01 00:00:00,3");
    assert_eq!(found.unwrap().values[0], [0.0, 0.25, 86400.25]);
    for wrong in [
        "2024-13-01 00:00",
        "2024-01-01",
        "2024-01-01 25:00",
        "24-01-01 00:00",
    ] {
        assert!(two(&format!("{wrong},1")).is_err(), "{wrong}");
    }
    let mixed = two("1,1\n2024-01-01 00:00,2").unwrap_err().to_string();
    assert!(mixed.contains("is a date, but the times above are numbers"));
}

#[test]
fn rows_outside_the_window_need_a_time_only() {
    let mut layout = layout(b' ', &["t", "y"]);
    layout.window = (1.0, 2.0);
    let table = b" 0  x\n1\t \"2\" \n2   3 \n3 nan";
    let found: Result<_, Fault> = read(table, &layout, || Ok(()));
    assert_eq!(found.unwrap().values, [[1.0, 2.0], [2.0, 3.0]]);
}

#[test]
fn the_check_ends_a_long_reading() {
    #[derive(Debug, PartialEq)]
    enum Ended {
        Fault(Fault),
        Check,
    }
    impl From<Fault> for Ended {
        fn from(fault: Fault) -> Self {
            Self::Fault(fault)
        }
    }
    let checks = std::cell::Cell::new(0);
    let table = "\n".repeat(10_000) + "x";
    let found = read(table.as_bytes(), &layout(b',', &["t"]), || {
        checks.set(checks.get() + 1);
        if checks.get() < 3 {
            Ok(())
        } else {
            Err(Ended::Check)
        }
    });
    assert_eq!(found, Err(Ended::Check));
}

/// Cells that come close to every branch of the reader of numbers.
fn digits() -> impl Strategy<Value = String> {
    (
        "[+-]?",
        "[0-9]{1,25}",
        "(\\.[0-9]{0,25})?",
        "([eE][+-]?[0-9]{1,3})?",
    )
        .prop_map(|(sign, whole, decimals, exponent)| sign + &whole + &decimals + &exponent)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn numbers_are_those_of_std(cell in prop_oneof![digits(), any::<f64>().prop_map(|x| format!("{x:?}"))]) {
        let known: f64 = cell.parse().unwrap();
        let Ok(Number::Whole(found) | Number::Point(found)) = number(cell.as_bytes()) else {
            return Err(TestCaseError::fail(cell));
        };
        prop_assert_eq!(found.to_bits(), known.to_bits(), "{}", cell);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn any_bytes_are_read_or_refused(
        table in proptest::collection::vec(
            prop_oneof![proptest::sample::select(b",;\t \n\r\"#0123456789.-e\xa0\xff".to_vec()), any::<u8>()],
            0..400,
        ),
        delimiter in proptest::sample::select(b",;\t 1\x1f".to_vec()),
    ) {
        let found: Result<Columns, Fault> = read(&table, &layout(delimiter, &["t", "y"]), || Ok(()));
        match found {
            Ok(columns) => {
                let [time, output] = &columns.values[..] else { return Err(TestCaseError::fail("two")); };
                prop_assert!(output.len() <= time.len() && 3 * output.len() <= table.len() + 1);
                prop_assert!(time.windows(2).all(|pair| pair[0] < pair[1]));
                prop_assert!(output.iter().all(|value| value.is_finite()));
            }
            Err(fault) => prop_assert_eq!(fault.to_string().lines().count(), 1),
        }
    }
}
