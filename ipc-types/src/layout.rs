//! What a sample or an enum of the wire contract looks like, as data: the schema and the C header are written from this
//! alone.

/// A type that may appear in a sample: `u8`, `u32`, `u64`, `f64`, and arrays of them with one or two dimensions.
pub trait WireType: Copy {
    /// Name of the scalar in the schema.
    const SCALAR: &'static str;
    /// Dimensions, outermost first; empty for a scalar.
    const SHAPE: &'static [usize];
    /// All bytes zero.
    const ZERO: Self;
}

/// A scalar of the wire contract.
pub trait WireScalar: WireType {}

macro_rules! wire_scalar {
    ($($scalar:ident = $zero:literal),+) => {
        $(
            impl WireType for $scalar {
                const SCALAR: &'static str = stringify!($scalar);
                const SHAPE: &'static [usize] = &[];
                const ZERO: Self = $zero;
            }
            impl WireScalar for $scalar {}
        )+
    };
}
wire_scalar!(u8 = 0, u32 = 0, u64 = 0, f64 = 0.0);

impl<T: WireScalar, const N: usize> WireType for [T; N] {
    const SCALAR: &'static str = T::SCALAR;
    const SHAPE: &'static [usize] = &[N];
    const ZERO: Self = [T::ZERO; N];
}

impl<T: WireScalar, const N: usize, const M: usize> WireType for [[T; N]; M] {
    const SCALAR: &'static str = T::SCALAR;
    const SHAPE: &'static [usize] = &[M, N];
    const ZERO: Self = [[T::ZERO; N]; M];
}

/// One field of a sample.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct FieldInfo {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// Scalar type: `u8`, `u32`, `u64` or `f64`.
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
}

/// One sample type.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct SampleInfo {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// Name that iceoryx2 compares when a service is opened; it ends in the schema version.
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

/// One value of a wire enum.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct EnumValueInfo {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// The code on the wire.
    pub code: u32,
    /// What it says.
    pub meaning: &'static str,
}

/// One wire enum: a `u32` with named codes.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct EnumInfo {
    /// Name in Rust, C and the schema.
    pub name: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Its values.
    pub values: &'static [EnumValueInfo],
}

/// A sample of the wire contract, declared by `wire_sample!`.
pub trait WireSample: Copy + core::fmt::Debug + iceoryx2::prelude::ZeroCopySend + 'static {
    /// Its layout and meaning.
    const INFO: SampleInfo;
}

/// An enum of the wire contract, declared by `wire_enum!`.
pub trait WireEnum: Copy + 'static {
    /// Its codes and their meaning.
    const INFO: EnumInfo;
}
