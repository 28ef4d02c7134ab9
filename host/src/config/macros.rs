//! The two macros that declare a configuration.

/// Declares a section of the configuration: a struct and all that is known about its keys. See
/// [`config`](crate::config) for the syntax.
///
/// The struct derives `Clone`, `Debug` and `PartialEq`, has public fields, and implements serde's
/// `Deserialize`, [`Section`](crate::config::Section) and [`Value`](crate::config::Value).
#[macro_export]
macro_rules! config_section {
    (
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident {
            $(
                $(#[doc = $meaning:literal])+
                $field:ident : $type:ty
                    $(= $default:expr)?
                    $(, unit $unit:literal)?
                    $(, range $range:expr)?
                    $(, length $length:expr)?
                    $(, each $each:literal)?
                ;
            )+
            $(removed $gone:ident $why:literal;)*
        }
        $(cross_check $cross_check:expr;)?
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Debug, PartialEq)]
        $visibility struct $name {
            $(
                $(#[doc = $meaning])+
                #[doc = ""]
                #[doc = concat!(
                    "" $(, "Unit: ", $unit, ". ")?
                    $(, "Range: `", stringify!($range), "`. ")?
                    $(, "Length: `", stringify!($length), "`. ")?
                    $(, "Default: `", stringify!($default), "`. ")?
                )]
                pub $field: $type,
            )+
        }

        const _: () = {
            use $crate::config::private::serde;
            use $crate::config::{ConfigError, Key, Kind, Limits, LimitsOf, NoRange, Section, Value, join};

            const NAME: &str = stringify!($name);
            const FIELDS: &[&str] = &[$(stringify!($field)),+];

            /// The default that the declaration gives to a key, and the limits of each key.
            struct Declared;

            impl Declared {
                $(
                    fn $field() -> (Option<$type>, Limits) {
                        #[allow(unused_mut, unused_assignments, reason = "keys without a default leave it as it is")]
                        let mut default: Option<$type> = None;
                        $( default = Some($default); )?
                        let limits = LimitsOf::<<$type as Value>::Scalar>::default()
                            $(.unit($unit))? $(.range($range))? $(.length($length))? $(.each($each))?;
                        (default, limits.limits())
                    }
                )+
            }

            impl Section for $name {
                fn schema() -> Vec<Key> {
                    let mut keys = vec![$({
                        let (default, limits) = Declared::$field();
                        let default = $crate::config::private::absent(default);
                        Key {
                            name: stringify!($field),
                            kind: <$type as Value>::kind(),
                            limits,
                            required: default.is_none(),
                            default: default.as_ref().map(Value::to_toml),
                            meaning: $crate::config::private::meaning(&[$($meaning),+]),
                            removed: None,
                        }
                    }),+];
                    keys.extend([$( Key::removed(stringify!($gone), $why) ),*]);
                    keys
                }

                fn check(&self, path: &str, errors: &mut Vec<ConfigError>) {
                    let before = errors.len();
                    $(
                        let (_, limits) = Declared::$field();
                        self.$field.check_value(&join(path, stringify!($field)), &limits, errors);
                    )+
                    if errors.len() == before {
                        self.cross_check(path, errors);
                    }
                }

                #[allow(unused_variables, reason = "not every section has rules between its keys")]
                fn cross_check(&self, path: &str, errors: &mut Vec<ConfigError>) {
                    $(
                        let check: fn(&$name, &str, &mut Vec<ConfigError>) = $cross_check;
                        check(self, path, errors);
                    )?
                }
            }

            impl Value for $name {
                type Scalar = NoRange;

                fn kind() -> Kind {
                    Kind::Section(<$name as Section>::schema)
                }

                fn when_missing() -> Option<Self> {
                    Some(Self { $( $field: $crate::config::private::absent(Declared::$field().0)?, )+ })
                }

                fn check_value(&self, path: &str, _: &Limits, errors: &mut Vec<ConfigError>) {
                    Section::check(self, path, errors);
                }

                fn to_toml(&self) -> String {
                    let entries = [$( format!("{} = {}", stringify!($field), Value::to_toml(&self.$field)) ),+];
                    format!("{{ {} }}", entries.join(", "))
                }
            }

            impl<'de> serde::Deserialize<'de> for $name {
                fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    struct Visitor;

                    impl<'de> serde::de::Visitor<'de> for Visitor {
                        type Value = $name;

                        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                            f.write_str(concat!("a table (", stringify!($name), ")"))
                        }

                        fn visit_map<A: serde::de::MapAccess<'de>>(self, mut map: A) -> Result<$name, A::Error> {
                            use serde::de::Error;
                            $( let mut $field: Option<$type> = None; )+
                            while let Some(key) = map.next_key::<String>()? {
                                match key.as_str() {
                                    $(
                                        stringify!($field) => {
                                            if $field.replace(map.next_value()?).is_some() {
                                                return Err(A::Error::duplicate_field(stringify!($field)));
                                            }
                                        }
                                    )+
                                    other => return Err(A::Error::unknown_field(other, FIELDS)),
                                }
                            }
                            Ok($name {
                                $(
                                    $field: match $field {
                                        Some(value) => value,
                                        None => $crate::config::private::absent(Declared::$field().0)
                                            .ok_or_else(|| A::Error::missing_field(stringify!($field)))?,
                                    },
                                )+
                            })
                        }
                    }

                    deserializer.deserialize_struct(NAME, FIELDS, Visitor)
                }
            }
        };
    };
}

/// Declares an enum whose values the configuration names: `Variant = "snake_case_name"`, each with
/// a doc comment.
///
/// The enum derives `Clone`, `Copy`, `Debug`, `PartialEq`, `Eq` and `Hash`, has the associated
/// constant `ALL` and the method `name()`, and implements `Display` (the name), serde's
/// `Deserialize` and [`Value`](crate::config::Value). A name that is not `snake_case` does not
/// compile.
#[macro_export]
macro_rules! config_enum {
    (
        $(#[$attribute:meta])*
        $visibility:vis enum $name:ident {
            $(
                $(#[doc = $meaning:literal])+
                $variant:ident = $text:literal
            ),+ $(,)?
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        $visibility enum $name {
            $(
                $(#[doc = $meaning])+
                #[doc = ""]
                #[doc = concat!("In the configuration: `\"", $text, "\"`.")]
                $variant,
            )+
        }

        #[allow(dead_code, reason = "not every enum's list and names are used by the program itself")]
        impl $name {
            /// All values, in the order of their declaration.
            $visibility const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The name that the configuration uses.
            $visibility const fn name(self) -> &'static str {
                match self {
                    $( Self::$variant => $text, )+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        const _: () = {
            use $crate::config::private::serde;
            use $crate::config::{Choice, ConfigError, Kind, Limits, NoRange, Value};

            const NAMES: &[&str] = &[$($text),+];
            const CHOICES: &[Choice] = &[$( Choice { name: $text, meaning: &[$($meaning),+] } ),+];

            $(
                assert!(
                    $crate::config::private::is_snake_case($text),
                    concat!("the name of ", stringify!($variant), " is not snake_case")
                );
            )+

            impl Value for $name {
                type Scalar = NoRange;

                fn kind() -> Kind {
                    Kind::Choice(CHOICES)
                }

                fn check_value(&self, _: &str, _: &Limits, _: &mut Vec<ConfigError>) {}

                fn to_toml(&self) -> String {
                    format!("\"{}\"", self.name())
                }
            }

            impl<'de> serde::Deserialize<'de> for $name {
                fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    use serde::de::Error;
                    let text = <String as serde::Deserialize>::deserialize(deserializer)?;
                    match text.as_str() {
                        $( $text => Ok(Self::$variant), )+
                        other => Err(D::Error::unknown_variant(other, NAMES)),
                    }
                }
            }
        };
    };
}

/// Says that a section is a whole file, which [`parse`](crate::config::parse) accepts. `completed f`
/// names a function from the file to itself: what a key says in another one's place, before the checks.
#[macro_export]
macro_rules! config_file {
    ($name:ty $(, completed $complete:path)?) => {
        impl $crate::config::File for $name {
            fn deserialized(text: &str) -> Result<Self, $crate::config::private::toml::de::Error> {
                $crate::config::private::toml::from_str::<Self>(text)$(.map($complete))?
            }
        }
    };
}
