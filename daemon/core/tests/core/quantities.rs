//! Instants and spans.

use admittance_core::quantities::{Instant, Span};

use crate::common::{at, ns};

#[test]
fn seconds_become_whole_nanoseconds() {
    let ns = |seconds: f64| Span::from_seconds(seconds).nanoseconds();
    assert_eq!((ns(0.004), ns(1.4e-9), ns(-1.0), ns(f64::NAN)), (4_000_000, 1, 0, 0));
    // Formulas use the number that it was made from.
    assert_eq!(Span::from_seconds(0.1).seconds().to_bits(), 0.1_f64.to_bits());
}

#[test]
fn time_ends_where_the_clock_does() {
    assert_eq!(at(5).since(at(9)), Span::ZERO);
    assert_eq!(at(u64::MAX) + ns(1), at(u64::MAX));
    assert_eq!(at(1) - ns(2), Instant::default());
    assert_eq!(ns(3) - ns(4), Span::ZERO);
}

#[test]
fn spans_are_compared_in_whole_nanoseconds() {
    // 0.1 + 0.2 is not 0.3, but as long.
    assert_eq!(Span::from_seconds(0.1) + Span::from_seconds(0.2), Span::from_seconds(0.3));
    assert!(Span::from_seconds(0.004) < Span::from_seconds(0.004 + 1e-9));
    assert_eq!(Span::from_seconds(0.004) * 3.5, ns(14_000_000));
}
