//! The layout of samples and enums of the wire contract, as data: the schema and the C header are
//! generated from this alone.

use admittance_vocabulary::EnumInfo;
use serde_json::Value;

/// A type that may appear in a sample: `u8`, `u32`, `u64`, `f64`, arrays of them with one or two
/// dimensions, and another sample.
pub trait WireType: Copy {
    /// Name of the scalar, or of the sample, in the schema.
    const SCALAR: &'static str;
    /// Dimensions, outermost first; empty for a scalar.
    const SHAPE: &'static [usize];
    /// All bytes zero.
    const ZERO: Self;

    /// Whether two values are the same to the bit; two NaN are, whatever their payloads.
    fn same_bits(&self, other: &Self) -> bool;

    /// The value as JSON, from which [`Self::from_json`] makes the same bits again (of a NaN, only
    /// that it is one): numbers as numbers, those that JSON lacks as "NaN", "inf" and "-inf",
    /// arrays as one list, row after row, samples as objects, codes as their names, sets of codes as
    /// lists of them.
    fn to_json(&self) -> Value;

    /// The value that [`Self::to_json`] wrote; `None` when it is another type's, or a field is
    /// missing.
    fn from_json(value: &Value) -> Option<Self>;
}

/// A scalar of the wire contract.
pub trait WireScalar: WireType {}

macro_rules! wire_scalar {
    ($($scalar:ident = $zero:literal, $same_bits:expr, $to_json:expr, $from_json:expr;)+) => {
        $(
            impl WireType for $scalar {
                const SCALAR: &'static str = stringify!($scalar);
                const SHAPE: &'static [usize] = &[];
                const ZERO: Self = $zero;

                fn same_bits(&self, other: &Self) -> bool {
                    $same_bits(self, other)
                }

                fn to_json(&self) -> Value {
                    $to_json(*self)
                }

                fn from_json(value: &Value) -> Option<Self> {
                    $from_json(value)
                }
            }
            impl WireScalar for $scalar {}
        )+
    };
}
wire_scalar! {
    u8 = 0, Self::eq, Value::from, |value: &Value| value.as_u64()?.try_into().ok();
    u32 = 0, Self::eq, Value::from, |value: &Value| value.as_u64()?.try_into().ok();
    u64 = 0, Self::eq, Value::from, Value::as_u64;
    f64 = 0.0, float_same_bits, float_to_json, float_from_json;
}

/// The name of a code; of one that is not declared its number, as text.
pub(crate) fn code_to_json(names: &EnumInfo, code: u32) -> Value {
    match names.values.iter().find(|value| value.code == code) {
        Some(value) => Value::from(value.name),
        None => Value::from(code.to_string()),
    }
}

/// The code that [`code_to_json`] wrote, or that was written as a number, as it was in earlier versions.
pub(crate) fn code_from_json(names: &EnumInfo, value: &Value) -> Option<u32> {
    let Some(text) = value.as_str() else { return u32::from_json(value) };
    let named = names.values.iter().find(|value| value.name == text).map(|value| value.code);
    named.or_else(|| text.parse().ok())
}

/// The names of a set of codes: bit i stands for code i.
pub(crate) fn codes_to_json(names: &EnumInfo, set: u32) -> Value {
    (0..u32::BITS).filter(|code| set & (1 << code) != 0).map(|code| code_to_json(names, code)).collect()
}

/// The set that [`codes_to_json`] wrote, or that was written as a number, as it was in earlier versions.
pub(crate) fn codes_from_json(names: &EnumInfo, value: &Value) -> Option<u32> {
    let Some(list) = value.as_array() else { return u32::from_json(value) };
    list.iter().try_fold(0, |set, name| Some(set | 1_u32.checked_shl(code_from_json(names, name)?)?))
}

fn float_same_bits(one: &f64, other: &f64) -> bool {
    one.to_bits() == other.to_bits() || (one.is_nan() && other.is_nan())
}

fn float_to_json(value: f64) -> Value {
    match serde_json::Number::from_f64(value) {
        Some(number) => Value::Number(number),
        None if value.is_nan() => Value::from("NaN"),
        None => Value::from(if value > 0.0 { "inf" } else { "-inf" }),
    }
}

fn float_from_json(value: &Value) -> Option<f64> {
    match value {
        Value::String(text) => match text.as_str() {
            "NaN" => Some(f64::NAN),
            "inf" => Some(f64::INFINITY),
            "-inf" => Some(f64::NEG_INFINITY),
            _ => None,
        },
        _ => value.as_f64(),
    }
}

impl<T: WireScalar, const N: usize> WireType for [T; N] {
    const SCALAR: &'static str = T::SCALAR;
    const SHAPE: &'static [usize] = &[N];
    const ZERO: Self = [T::ZERO; N];

    fn same_bits(&self, other: &Self) -> bool {
        self.iter().zip(other).all(|(one, other)| one.same_bits(other))
    }

    fn to_json(&self) -> Value {
        self.iter().map(T::to_json).collect()
    }

    fn from_json(value: &Value) -> Option<Self> {
        <[Self; 1]>::from_json(value).map(|[array]| array)
    }
}

impl<T: WireScalar, const N: usize, const M: usize> WireType for [[T; N]; M] {
    const SCALAR: &'static str = T::SCALAR;
    const SHAPE: &'static [usize] = &[M, N];
    const ZERO: Self = [[T::ZERO; N]; M];

    fn same_bits(&self, other: &Self) -> bool {
        self.iter().zip(other).all(|(one, other)| one.same_bits(other))
    }

    fn to_json(&self) -> Value {
        self.as_flattened().iter().map(T::to_json).collect()
    }

    fn from_json(value: &Value) -> Option<Self> {
        let list = value.as_array().filter(|list| list.len() == M * N)?;
        let mut array = Self::ZERO;
        for (slot, value) in array.as_flattened_mut().iter_mut().zip(list) {
            *slot = T::from_json(value)?;
        }
        Some(array)
    }
}

/// One field of a sample.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct FieldInfo {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// Scalar type: `u8`, `u32`, `u64` or `f64`; or the name of the sample type that the field
    /// holds.
    #[serde(rename = "type")]
    pub scalar: &'static str,
    /// Dimensions, outermost first; empty for a scalar.
    pub shape: &'static [usize],
    /// Bytes from the start of the sample.
    pub offset: usize,
    /// Unit; `1` for counts and codes.
    pub unit: &'static str,
    /// Values that a correct writer sends.
    pub range: &'static str,
    /// What the value says, with frame and sign.
    pub meaning: &'static str,
    /// The wire enum whose codes the field holds.
    #[serde(rename = "enum")]
    pub enumeration: Option<&'static str>,
    /// The wire enum of which the field holds a set: bit i stands for code i.
    pub set_of: Option<&'static str>,
}

/// One sample type.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct SampleInfo {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// Name that iceoryx2 compares when a service is opened; it ends in the version of the sample.
    pub type_name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Bytes.
    pub alignment: usize,
    /// Who writes it.
    pub writer: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Its fields in the order of their offsets, without gaps.
    pub fields: &'static [FieldInfo],
}

/// A sample of the wire contract, declared by `wire_sample!`.
pub trait WireSample: WireType + core::fmt::Debug + iceoryx2::prelude::ZeroCopySend + 'static {
    /// Its layout and meaning.
    const INFO: SampleInfo;
}
