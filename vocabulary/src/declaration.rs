//! How a name is declared: one macro gives the enum, its codes, names and meanings, and the entry
//! in the schema of the wire contract.

/// A declared enum in the schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EnumInfo {
    /// Name in the schema.
    pub name: &'static str,
    /// What it says.
    pub meaning: &'static str,
    /// All values, in the order of declaration.
    pub values: &'static [EnumValueInfo],
}

/// One value of a declared enum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EnumValueInfo {
    /// Name in the schema.
    pub name: &'static str,
    /// Code on the wire.
    pub code: u32,
    /// The meaning of the value, as a sentence.
    pub meaning: &'static str,
}

/// A declared enum.
pub trait Named {
    /// Its entry in the schema.
    const INFO: EnumInfo;
}

/// Declares an enum: its name in the schema, and for each value its code on the wire, its name
/// there where that is another (`as "name"`), and its meaning. `(none = CODE "meaning");` before the
/// values declares the code for no value.
#[macro_export]
macro_rules! vocabulary {
    (@name $value:ident) => { stringify!($value) };
    (@name $value:ident $value_name:literal) => { $value_name };
    (
        $(#[doc = $doc:literal])+
        pub enum $name:ident as $schema:literal {
            $( (none = $none:literal $none_meaning:literal); )?
            $( $value:ident = $code:literal $(as $value_name:literal)? $meaning:literal; )+
        }
    ) => {
        $(#[doc = $doc])+
        #[repr(u32)]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name {
            $( #[doc = concat!($meaning, " Code ", stringify!($code), ".")] $value = $code, )+
        }

        impl $name {
            /// All values, in the order of declaration.
            pub const ALL: &'static [Self] = &[$( Self::$value, )+];

            $(
                #[doc = concat!("Code of there being none: ", $none_meaning)]
                pub const NONE: u32 = $none;

                /// The code on the wire; for `None` the code for no value.
                pub const fn code_of(value: Option<Self>) -> u32 {
                    match value {
                        Some(value) => value.code(),
                        None => Self::NONE,
                    }
                }
            )?

            /// The value of a code; `None` for an unknown code.
            pub const fn from_code(code: u32) -> Option<Self> {
                match code {
                    $( $code => Some(Self::$value), )+
                    _ => None,
                }
            }

            /// The name of a code; "unknown" for one that is not declared.
            pub const fn name_of(code: u32) -> &'static str {
                match code {
                    $( $none => "None", )?
                    $( $code => $crate::vocabulary!(@name $value $($value_name)?), )+
                    _ => "unknown",
                }
            }

            /// The code on the wire.
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// The name in the schema.
            pub const fn name(self) -> &'static str {
                match self {
                    $( Self::$value => $crate::vocabulary!(@name $value $($value_name)?), )+
                }
            }

            /// The meaning of the value, as a sentence.
            pub const fn meaning(self) -> &'static str {
                match self {
                    $( Self::$value => $meaning, )+
                }
            }
        }

        impl ::core::fmt::Display for $name {
            fn fmt(&self, f: &mut ::core::fmt::Formatter<'_>) -> ::core::fmt::Result {
                f.pad(self.name())
            }
        }

        impl $crate::Named for $name {
            const INFO: $crate::EnumInfo = $crate::EnumInfo {
                name: $schema,
                meaning: concat!($($doc),+).trim_ascii(),
                values: &[
                    $( $crate::EnumValueInfo { name: "None", code: $none, meaning: $none_meaning }, )?
                    $(
                        $crate::EnumValueInfo {
                            name: $crate::vocabulary!(@name $value $($value_name)?),
                            code: $code,
                            meaning: $meaning,
                        },
                    )+
                ],
            };
        }
    };
}
