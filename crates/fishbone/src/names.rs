//! Names of variants in files, in other languages and on the web: one literal for each.

/// An enum whose variants have names.
pub trait Named {
    /// The variant's name in files and in other languages.
    fn name(&self) -> &'static str;

    /// The names of all variants.
    fn names() -> Vec<&'static str>;
}

/// Gives the variants of an enum their names.
///
/// `named! { enum … { Variant = "name", … } }` makes an enum of words and lists all in `ALL`; with the feature `io`, serde
/// and the schema read the same names. `named!(impl Enum { Variant = "name", … ..Inner, })` names an enum that is made
/// elsewhere or has data; its variant `Inner(Inner)` has the name of the error inside.
macro_rules! named {
    (
        $(#[$attribute:meta])*
        pub enum $enum:ident {
            $($(#[$of_variant:meta])* $variant:ident = $name:literal,)+
        }
    ) => {
        $(#[$attribute])*
        #[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
        pub enum $enum {
            $($(#[$of_variant])* #[cfg_attr(feature = "io", serde(rename = $name))] $variant,)+
        }

        impl $enum {
            /// Variants in order, one of each.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];
        }

        $crate::names::named!(impl $enum { $($variant = $name,)+ });
    };
    (impl $enum:ident { $($variant:ident = $name:literal,)+ $(..$inner:ident,)* }) => {
        impl $crate::names::Named for $enum {
            fn name(&self) -> &'static str {
                match self {
                    $(Self::$variant { .. } => $name,)+
                    $(Self::$inner(inner) => inner.name(),)*
                }
            }

            fn names() -> Vec<&'static str> {
                [vec![$($name),+], $($inner::names()),*].concat()
            }
        }
    };
}

pub(crate) use named;

#[cfg(test)]
mod tests {
    use super::Named;
    use crate::analysis::margin::NoMargin;

    #[test]
    fn an_error_in_another_keeps_its_name() {
        let inner = crate::analysis::continuation::NoBranch::Singular;
        assert_eq!(NoMargin::from(inner.clone()).name(), inner.name());
        assert!(NoMargin::names().contains(&inner.name()));
    }
}
