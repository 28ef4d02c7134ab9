//! The macro that declares a sample of the wire contract. From one declaration come the Rust type,
//! its documentation, the compile-time layout checks, the schema entry and the C header.

/// Declares a sample. Per field: byte offset, name, type, optionally `as` the wire enum of its
/// codes, or in braces of its bits, `[unit, range]`, meaning.
macro_rules! wire_sample {
    (
        $(#[doc = $doc:literal])+
        struct $name:ident: $type_name:literal, size $size:literal, writer $writer:literal {
            $(
                $offset:literal $field:ident: $ty:ty $(as $($enumeration:ident)? $({$set:ident})?)?
                    [$unit:literal, $range:literal]
                    $meaning:literal;
            )+
        }
    ) => {
        #[allow(rustdoc::broken_intra_doc_links, reason = "the same words are the schema's, where brackets are no links")]
        $(#[doc = $doc])+
        #[doc = ""]
        #[doc = concat!("Written by ", $writer, ". ", stringify!($size), " bytes, type name `", $type_name, "`.")]
        #[repr(C)]
        #[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
        #[type_name($type_name)]
        pub struct $name {
            $(
                #[doc = $meaning]
                #[doc = ""]
                $(
                    $( #[doc = concat!("A code of [`crate::", stringify!($enumeration), "`].")] )?
                    $( #[doc = concat!("Bit i stands for code i of [`crate::", stringify!($set), "`].")] )?
                )?
                #[doc = concat!("Unit: ", $unit, ". Range: ", $range, ". Offset: ", stringify!($offset), ".")]
                pub $field: $ty,
            )+
        }

        impl $name {
            /// A sample with all bytes zero.
            pub const fn zeroed() -> Self {
                Self { $( $field: <$ty as $crate::layout::WireType>::ZERO, )+ }
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::zeroed()
            }
        }

        impl $crate::layout::WireType for $name {
            const SCALAR: &'static str = stringify!($name);
            const SHAPE: &'static [usize] = &[];
            const ZERO: Self = Self::zeroed();

            fn same_bits(&self, other: &Self) -> bool {
                $( self.$field.same_bits(&other.$field) )&&+
            }

            fn to_json(&self) -> serde_json::Value {
                let mut object = serde_json::Map::new();
                $( object.insert(
                    stringify!($field).to_owned(),
                    wire_sample!(@to_json self.$field $($(, $enumeration)? $(, {$set})?)?),
                ); )+
                serde_json::Value::Object(object)
            }

            fn from_json(value: &serde_json::Value) -> Option<Self> {
                let object = value.as_object()?;
                Some(Self {
                    $( $field: wire_sample!(@from_json object.get(stringify!($field))?, $ty
                        $($(, $enumeration)? $(, {$set})?)?)?, )+
                })
            }
        }

        impl $crate::layout::WireSample for $name {
            const INFO: $crate::layout::SampleInfo = $crate::layout::SampleInfo {
                name: stringify!($name),
                type_name: $type_name,
                size: $size,
                alignment: 8,
                writer: $writer,
                meaning: concat!($($doc),+).trim_ascii(),
                fields: &[$(
                    $crate::layout::FieldInfo {
                        name: stringify!($field),
                        scalar: <$ty as $crate::layout::WireType>::SCALAR,
                        shape: <$ty as $crate::layout::WireType>::SHAPE,
                        offset: $offset,
                        unit: $unit,
                        range: $range,
                        meaning: $meaning,
                        enumeration: wire_sample!(@enumeration $($($enumeration)?)?),
                        set_of: wire_sample!(@enumeration $($($set)?)?),
                    },
                )+],
            };
        }

        const _: () = {
            assert!(core::mem::size_of::<$name>() == $size, concat!("size of ", stringify!($name)));
            assert!(core::mem::align_of::<$name>() == 8, concat!("alignment of ", stringify!($name)));
            $(
                assert!(
                    core::mem::offset_of!($name, $field) == $offset,
                    concat!("offset of ", stringify!($name), ".", stringify!($field))
                );
            )+
            assert!(0 $(+ core::mem::size_of::<$ty>())+ == $size, concat!("padding inside ", stringify!($name)));
        };
    };
    (@to_json $value:expr) => { $value.to_json() };
    (@to_json $value:expr, $enumeration:ident) => {
        $crate::layout::code_to_json(&<$crate::$enumeration as admittance_vocabulary::Named>::INFO, $value)
    };
    (@to_json $value:expr, {$set:ident}) => {
        $crate::layout::codes_to_json(&<$crate::$set as admittance_vocabulary::Named>::INFO, $value)
    };
    (@from_json $value:expr, $ty:ty) => { <$ty>::from_json($value) };
    (@from_json $value:expr, $ty:ty, $enumeration:ident) => {
        $crate::layout::code_from_json(&<$crate::$enumeration as admittance_vocabulary::Named>::INFO, $value)
    };
    (@from_json $value:expr, $ty:ty, {$set:ident}) => {
        $crate::layout::codes_from_json(&<$crate::$set as admittance_vocabulary::Named>::INFO, $value)
    };
    (@enumeration) => { None };
    (@enumeration $enumeration:ident) => {
        Some(<$crate::$enumeration as admittance_vocabulary::Named>::INFO.name)
    };
}
