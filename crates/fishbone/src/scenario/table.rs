//! The declaration of tables of a scenario.

/// Declares a struct that stands as a table in scenario files.
///
/// It is written with the attributes of serde and schemars for its fields, after their comments. Without the feature `io`
/// these two crates are not there, and the macro leaves their attributes out. A file that names a field unknown to the
/// table is refused.
macro_rules! table {
    (
        $(#[doc $($doc:tt)*])*
        #[derive($($derive:tt)*)]
        $(#[serde($($serde:tt)*)])?
        pub struct $struct:ident {
            $(
                $(#[doc $($doc_of_field:tt)*])*
                $(#[serde($($serde_of_field:tt)*)])?
                $(#[schemars($($schema_of_field:tt)*)])?
                pub $field:ident: $type:ty,
            )+
        }
    ) => {
        $(#[doc $($doc)*])*
        #[derive($($derive)*)]
        #[cfg_attr(
            feature = "io",
            derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema),
            serde(deny_unknown_fields $(, $($serde)*)?)
        )]
        pub struct $struct {
            $(
                $(#[doc $($doc_of_field)*])*
                $(#[cfg_attr(feature = "io", serde($($serde_of_field)*))])?
                $(#[cfg_attr(feature = "io", schemars($($schema_of_field)*))])?
                pub $field: $type,
            )+
        }
    };
}

pub(super) use table;
