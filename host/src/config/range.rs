//! Accepted ranges of numbers and lengths.

use std::cmp::Ordering;
use std::fmt;
use std::marker::PhantomData;
use std::ops::{Bound, RangeBounds};

/// A number of a configuration, exact for every type that a key may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// Any integer.
    Integer(i128),
    /// A float, perhaps not finite.
    Float(f64),
}

impl Number {
    /// Whether it is neither infinite nor NaN.
    pub fn is_finite(self) -> bool {
        match self {
            Self::Integer(_) => true,
            Self::Float(x) => x.is_finite(),
        }
    }

    fn compare(self, other: Self) -> Option<Ordering> {
        match (self, other) {
            (Self::Integer(a), Self::Integer(b)) => Some(a.cmp(&b)),
            (Self::Float(a), Self::Float(b)) => a.partial_cmp(&b),
            // A whole number given for a float key.
            (Self::Integer(a), Self::Float(b)) => (a as f64).partial_cmp(&b),
            (Self::Float(a), Self::Integer(b)) => a.partial_cmp(&(b as f64)),
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(i) => write!(f, "{i}"),
            Self::Float(x) => {
                // Debug switches to an exponent for very large and very small numbers, Display
                // never does.
                let text = format!("{x:?}");
                write!(f, "{}", text.strip_suffix(".0").unwrap_or(&text))
            }
        }
    }
}

/// The interval in which a number must lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower end.
    pub low: Bound<Number>,
    /// Upper end.
    pub high: Bound<Number>,
}

impl Bounds {
    /// Accepts every finite number.
    pub const ANY: Self = Self { low: Bound::Unbounded, high: Bound::Unbounded };

    /// Bounds from a Rust range; an open end is as wide as the type.
    pub fn of<S: Scalar>(range: impl RangeBounds<S>) -> Self {
        let natural = S::natural();
        let end = |bound: Bound<&S>, natural| match bound {
            Bound::Unbounded => natural,
            other => other.map(|x| x.number()),
        };
        Self { low: end(range.start_bound(), natural.low), high: end(range.end_bound(), natural.high) }
    }

    /// Whether the number is finite and inside.
    pub fn accept(&self, x: Number) -> bool {
        let above = match self.low {
            Bound::Included(low) => matches!(x.compare(low), Some(Ordering::Greater | Ordering::Equal)),
            Bound::Excluded(low) => x.compare(low) == Some(Ordering::Greater),
            Bound::Unbounded => true,
        };
        let below = match self.high {
            Bound::Included(high) => matches!(x.compare(high), Some(Ordering::Less | Ordering::Equal)),
            Bound::Excluded(high) => x.compare(high) == Some(Ordering::Less),
            Bound::Unbounded => true,
        };
        x.is_finite() && above && below
    }

    /// The smallest accepted integer, at least 0: for lengths.
    pub(super) fn least(&self) -> usize {
        match self.low {
            Bound::Included(Number::Integer(i)) => usize::try_from(i).unwrap_or(0),
            Bound::Excluded(Number::Integer(i)) => usize::try_from(i + 1).unwrap_or(0),
            _ => 0,
        }
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use Bound::{Excluded, Included, Unbounded};
        match (self.low, self.high) {
            (Included(a), Included(b)) if a == b => write!(f, "{a}"),
            (Included(a), Included(b)) => write!(f, "{a} to {b}"),
            (Included(a), Excluded(b)) => write!(f, "{a} to below {b}"),
            (Excluded(a), Included(b)) => write!(f, "above {a} to {b}"),
            (Excluded(a), Excluded(b)) => write!(f, "above {a} to below {b}"),
            (Included(a), Unbounded) => write!(f, "at least {a}"),
            (Excluded(a), Unbounded) => write!(f, "above {a}"),
            (Unbounded, Included(b)) => write!(f, "at most {b}"),
            (Unbounded, Excluded(b)) => write!(f, "below {b}"),
            (Unbounded, Unbounded) => write!(f, "any finite number"),
        }
    }
}

/// A number type that a key can have.
pub trait Scalar: Copy {
    /// The value, exactly.
    fn number(self) -> Number;
    /// What the type itself can hold.
    fn natural() -> Bounds;
}

impl Scalar for f64 {
    fn number(self) -> Number {
        Number::Float(self)
    }

    fn natural() -> Bounds {
        Bounds::ANY
    }
}

macro_rules! integer_scalar {
    ($($integer:ty),+) => { $(
        impl Scalar for $integer {
            fn number(self) -> Number {
                Number::Integer(self as i128)
            }

            fn natural() -> Bounds {
                let end = |i: $integer| Bound::Included(i.number());
                Bounds { low: end(<$integer>::MIN), high: end(<$integer>::MAX) }
            }
        }
    )+ };
}
integer_scalar!(i32, i64, u8, u16, u32, u64, usize);

/// Scalar type of the keys that are no numbers. It has no values, so that a range on such a key
/// does not compile.
#[derive(Clone, Copy, Debug)]
pub enum NoRange {}

impl Scalar for NoRange {
    fn number(self) -> Number {
        match self {}
    }

    fn natural() -> Bounds {
        Bounds::ANY
    }
}

/// Unit, range and length of a key, as declared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Unit of the number or of each element; `"1"` when it has no dimension.
    pub unit: Option<&'static str>,
    /// Range of the number or of each element.
    pub range: Bounds,
    /// Number of elements of a list, or of characters of a string.
    pub length: Option<Bounds>,
    /// Whether a list has one element for each task axis.
    pub per_axis: bool,
}

impl Limits {
    /// The unit as messages show it: nothing for "1".
    pub fn shown_unit(&self) -> Option<&'static str> {
        self.unit.filter(|unit| *unit != "1")
    }

    /// Whether this string is accepted: by its length, and as one that can be shown.
    pub fn accept_text(&self, text: &str) -> bool {
        self.accept_length(text.chars().count()) && !text.contains(char::is_control)
    }

    /// Whether a list or string of this length is accepted.
    pub fn accept_length(&self, length: usize) -> bool {
        self.length.is_none_or(|bounds| bounds.accept(length.number()))
    }
}

/// Builds [`Limits`] for a key of scalar type `S`; used by
/// [`config_section!`](crate::config_section).
#[derive(Debug)]
pub struct LimitsOf<S> {
    limits: Limits,
    scalar: PhantomData<S>,
}

impl<S: Scalar> Default for LimitsOf<S> {
    fn default() -> Self {
        Self { limits: Limits { unit: None, range: S::natural(), length: None, per_axis: false }, scalar: PhantomData }
    }
}

impl<S: Scalar> LimitsOf<S> {
    /// Sets the unit.
    pub fn unit(mut self, unit: &'static str) -> Self {
        self.limits.unit = Some(unit);
        self
    }

    /// Sets the range of the number or of each element.
    pub fn range(mut self, range: impl RangeBounds<S>) -> Self {
        self.limits.range = Bounds::of(range);
        self
    }

    /// Sets the accepted number of elements or characters.
    pub fn length(mut self, length: impl RangeBounds<usize>) -> Self {
        let open_end = matches!(length.end_bound(), Bound::Unbounded);
        let mut bounds = Bounds::of(length);
        if open_end {
            bounds.high = Bound::Unbounded;
        }
        self.limits.length = Some(bounds);
        self
    }

    /// Sets what a list has one element for: "axis" is known.
    pub fn each(mut self, what: &str) -> Self {
        self.limits.per_axis = what == "axis";
        self
    }

    /// The limits.
    pub fn limits(self) -> Limits {
        self.limits
    }
}
