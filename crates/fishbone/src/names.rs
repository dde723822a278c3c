//! The words by which variants are called in files, in other languages and on the web: one literal for each.

/// What is one of several, each with a name.
pub trait Named {
    /// Its name in files and in other languages.
    fn name(&self) -> &'static str;

    /// The names of all that it could be.
    fn names() -> Vec<&'static str>;
}

/// Gives the variants of an enum their names.
///
/// `named! { enum … { Variant = "name", … } }` makes an enum of words, of which serde and the schema read the same
/// names, and lists all in `ALL`. `named!(impl Enum { Variant = "name", … ..Inner, })` names an enum that is made
/// elsewhere or has data; its variant `Inner(Inner)` is called what the other error in it is called.
macro_rules! named {
    (
        $(#[$attribute:meta])*
        pub enum $enum:ident {
            $($(#[$of_variant:meta])* $variant:ident = $name:literal,)+
        }
    ) => {
        $(#[$attribute])*
        pub enum $enum {
            $($(#[$of_variant])* #[serde(rename = $name)] $variant,)+
        }

        impl $enum {
            /// All of them, in order.
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
    use crate::analysis::continuation::{End, Kind};
    use crate::analysis::margin::NoMargin;
    use crate::analysis::path::Motion;
    use crate::equilibrium::Status;
    use crate::scenario::{Axis, Method};
    use crate::strip::developable::EnergyModel;
    use serde::Serialize;

    /// All names are told apart, and serde knows each by the same.
    fn check<T: Named + Serialize>(all: &[T]) {
        let names: Vec<_> = all.iter().map(T::name).collect();
        assert_eq!(names, T::names());
        let written = serde_json::to_value(all).unwrap();
        assert_eq!(written, serde_json::to_value(&names).unwrap());
        let mut apart = names.clone();
        apart.sort_unstable();
        apart.dedup();
        assert_eq!(apart.len(), names.len());
    }

    #[test]
    fn serde_writes_the_names() {
        check(Status::ALL);
        check(EnergyModel::ALL);
        check(Method::ALL);
        check(Axis::ALL);
        check(Motion::ALL);
        check(Kind::ALL);
        check(End::ALL);
    }

    #[test]
    fn an_error_in_another_keeps_its_name() {
        let inner = crate::analysis::continuation::NoBranch::Singular;
        assert_eq!(NoMargin::from(inner.clone()).name(), inner.name());
        assert!(NoMargin::names().contains(&inner.name()));
    }
}
