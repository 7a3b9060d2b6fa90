//! One table of names for the variants of an enum.

/// Gives an enum without fields `ALL`, `name` and `from_name`; with a word for what it is
/// also `Display`, and `FromStr` whose error lists the names.
///
/// ```
/// #[derive(Clone, Copy, Debug, PartialEq)]
/// enum Side { Left, Right }
/// servodance_types::named!(Side, "side" { Left "left", Right "right" });
/// assert_eq!("right".parse(), Ok(Side::Right));
/// let error = "up".parse::<Side>().unwrap_err();
/// assert_eq!(error, "unknown side `up`; choose one of: left, right");
/// ```
#[macro_export]
macro_rules! named {
    ($type:ident { $($variant:ident $name:literal),* $(,)? }) => {
        impl $type {
            /// All of them, in order.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$variant),*];

            /// The name in files, options and messages.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }

            /// The one of that name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|one| one.name() == name)
            }
        }
    };
    ($type:ident, $what:literal { $($names:tt)* }) => {
        $crate::named!($type { $($names)* });

        impl ::std::fmt::Display for $type {
            fn fmt(&self, f: &mut ::std::fmt::Formatter<'_>) -> ::std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl ::std::str::FromStr for $type {
            type Err = String;

            fn from_str(name: &str) -> Result<Self, String> {
                Self::from_name(name).ok_or_else(|| {
                    let names = Self::ALL.map(Self::name).join(", ");
                    format!("unknown {} `{name}`; choose one of: {names}", $what)
                })
            }
        }
    };
}
