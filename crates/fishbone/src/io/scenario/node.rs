//! A format-free tree of values, and the reading of the schema from it with exact field paths.
//!
//! Serde's own readers of TOML and JSON turn errors into text before the path of the field is known; reading from a tree of
//! our own keeps errors as data, and gives both formats one set of messages.

use crate::scenario::error::{LONGEST_QUOTE, ScenarioError, cut, number};
use serde::Deserialize;
use serde::de::{
    self, DeserializeSeed, Deserializer, Expected, IntoDeserializer, Unexpected, Visitor,
};
use std::fmt::{self, Display};
use std::vec;

/// Key under which the TOML reader hands over a date, a word.
const TOML_DATE_KEY: &str = "$__toml_private_datetime";

/// A value of TOML or JSON.
#[derive(Debug, PartialEq)]
pub(super) enum Node {
    Null,
    Bool(bool),
    Integer(i64),
    Float(f64),
    Text(String),
    Date,
    Array(Vec<Node>),
    /// Sorted by key, each key once.
    Table(Vec<(String, Node)>),
}

impl Node {
    /// The value in words, as an error repeats it.
    fn describe(&self) -> String {
        match self {
            Self::Null => "null".into(),
            Self::Bool(value) => value.to_string(),
            Self::Integer(value) => value.to_string(),
            Self::Float(value) => number(*value),
            Self::Text(text) => quote(text),
            Self::Date => "a date".into(),
            Self::Array(entries) => count(entries.len()),
            Self::Table(_) => "a table".into(),
        }
    }

    fn refuse<T>(&self, allowed: impl Into<String>) -> Result<T, Located> {
        Err(Located(ScenarioError::invalid(
            "",
            self.describe(),
            allowed,
        )))
    }
}

fn count(entries: usize) -> String {
    match entries {
        1 => "an array of 1 entry".into(),
        n => format!("an array of {n} entries"),
    }
}

/// A text in quotes, on one line and cut to a readable length.
fn quote(text: &str) -> String {
    format!("\"{}\"", cut(text))
}

/// The word of a list that was probably meant.
pub(super) fn nearest<W: AsRef<str>>(found: &str, words: &[W]) -> Option<String> {
    if found.chars().count() > LONGEST_QUOTE {
        return None;
    }
    let found = found.to_lowercase();
    let distance = |word: &str| strsim::damerau_levenshtein(&found, &word.to_lowercase());
    words
        .iter()
        .map(|word| (distance(word.as_ref()), word.as_ref()))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, word)| *distance <= 1 + word.chars().count() / 4)
        .map(|(_, word)| word.to_owned())
}

fn owned(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Node, E> {
        Ok(Node::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Node, E> {
        Ok(Node::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Integer(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Node, E> {
        Ok(i64::try_from(value).map_or(Node::Float(value as f64), Node::Integer))
    }

    fn visit_i128<E>(self, value: i128) -> Result<Node, E> {
        Ok(Node::Float(value as f64))
    }

    fn visit_u128<E>(self, value: u128) -> Result<Node, E> {
        Ok(Node::Float(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Float(value))
    }

    fn visit_str<E>(self, text: &str) -> Result<Node, E> {
        Ok(Node::Text(text.to_owned()))
    }

    fn visit_string<E>(self, text: String) -> Result<Node, E> {
        Ok(Node::Text(text))
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut entries: A) -> Result<Node, A::Error> {
        let mut nodes = Vec::new();
        while let Some(node) = entries.next_element()? {
            nodes.push(node);
        }
        nodes.shrink_to_fit();
        Ok(Node::Array(nodes))
    }

    fn visit_map<A: de::MapAccess<'de>>(self, mut entries: A) -> Result<Node, A::Error> {
        let mut fields: Vec<(String, Node)> = Vec::new();
        while let Some(field) = entries.next_entry()? {
            fields.push(field);
        }
        if fields.first().is_some_and(|(key, _)| key == TOML_DATE_KEY) {
            return Ok(Node::Date);
        }
        fields.shrink_to_fit();
        fields.sort_by(|a, b| a.0.cmp(&b.0));
        match fields.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some(pair) => Err(de::Error::custom(format_args!(
                "duplicate key {}",
                quote(&pair[0].0)
            ))),
            None => Ok(Node::Table(fields)),
        }
    }
}

/// An error on its way up through the tree: its field is relative to the node it has reached.
#[derive(Debug)]
pub(super) struct Located(pub(super) ScenarioError);

impl Located {
    fn within(self, step: impl Display) -> Self {
        Self(self.0.map_field(|field| match field {
            "" => step.to_string(),
            _ if field.starts_with('[') => format!("{step}{field}"),
            _ => format!("{step}.{field}"),
        }))
    }
}

impl Display for Located {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for Located {}

impl de::Error for Located {
    fn custom<T: Display>(message: T) -> Self {
        Self(ScenarioError::invalid(
            "",
            format!("an unreadable value ({message})"),
            "as the schema says",
        ))
    }

    fn invalid_type(found: Unexpected, allowed: &dyn Expected) -> Self {
        Self(ScenarioError::invalid(
            "",
            describe_unexpected(&found),
            allowed.to_string(),
        ))
    }

    fn invalid_value(found: Unexpected, allowed: &dyn Expected) -> Self {
        Self::invalid_type(found, allowed)
    }

    fn unknown_field(name: &str, allowed: &'static [&'static str]) -> Self {
        Self(ScenarioError::UnknownField {
            field: cut(name),
            nearest: nearest(name, allowed),
            allowed: owned(allowed),
        })
    }

    fn missing_field(name: &'static str) -> Self {
        Self(ScenarioError::invalid(name, "nothing", "given"))
    }
}

fn describe_unexpected(found: &Unexpected) -> String {
    match found {
        Unexpected::Str(text) => quote(text),
        Unexpected::Float(value) => number(*value),
        Unexpected::Signed(value) => value.to_string(),
        Unexpected::Unsigned(value) => value.to_string(),
        Unexpected::Bool(value) => value.to_string(),
        Unexpected::Unit => "null".into(),
        Unexpected::Seq => "an array".into(),
        Unexpected::Map => "a table".into(),
        other => other.to_string(),
    }
}

impl<'de> Deserializer<'de> for Node {
    type Error = Located;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Null => visitor.visit_unit(),
            Self::Bool(value) => visitor.visit_bool(value),
            Self::Integer(value) => visitor.visit_i64(value),
            Self::Float(value) => visitor.visit_f64(value),
            Self::Text(text) => visitor.visit_string(text),
            Self::Date => Err(de::Error::invalid_type(
                Unexpected::Other("a date"),
                &visitor,
            )),
            Self::Array(entries) => visitor.visit_seq(Entries::new(entries)),
            Self::Table(fields) => visitor.visit_map(Fields::new(fields)),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Null => visitor.visit_none(),
            node => visitor.visit_some(node),
        }
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Integer(_) | Self::Float(_) => self.deserialize_any(visitor),
            node => node.refuse("a number"),
        }
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Integer(value) if value >= 0 => visitor.visit_i64(value),
            node => node.refuse("a whole number, not negative"),
        }
    }

    fn deserialize_i32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Integer(value) if i32::try_from(value).is_ok() => visitor.visit_i64(value),
            node => node.refuse("a whole number of at most 32 bits"),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Bool(value) => visitor.visit_bool(value),
            node => node.refuse("true or false"),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Text(text) => visitor.visit_string(text),
            node => node.refuse("a text in quotes"),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Located> {
        match self {
            Self::Array(entries) => visitor.visit_seq(Entries::new(entries)),
            node => node.refuse("an array"),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        len: usize,
        visitor: V,
    ) -> Result<V::Value, Located> {
        match self {
            Self::Array(entries) if entries.len() == len => {
                visitor.visit_seq(Entries::new(entries))
            }
            node => node.refuse(count(len)),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Located> {
        match self {
            Self::Table(fields) => visitor.visit_map(Fields::new(fields)),
            node => node.refuse("a table"),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Located> {
        match self {
            Self::Text(word) if variants.contains(&word.as_str()) => {
                visitor.visit_enum(word.into_deserializer())
            }
            Self::Text(word) => Err(Located(ScenarioError::choice(&word, variants))),
            node => node.refuse(format!("one of {}", variants.join(", "))),
        }
    }

    serde::forward_to_deserialize_any! {
        i8 i16 i64 i128 u8 u16 u32 u128 f32 char str bytes byte_buf unit unit_struct newtype_struct tuple_struct map
        identifier ignored_any
    }
}

/// The entries of an array, read one by one.
struct Entries {
    rest: vec::IntoIter<Node>,
    index: usize,
}

impl Entries {
    fn new(entries: Vec<Node>) -> Self {
        Self {
            rest: entries.into_iter(),
            index: 0,
        }
    }
}

impl<'de> de::SeqAccess<'de> for Entries {
    type Error = Located;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Located> {
        let Some(node) = self.rest.next() else {
            return Ok(None);
        };
        let index = self.index;
        self.index += 1;
        seed.deserialize(node)
            .map(Some)
            .map_err(|error| error.within(format_args!("[{index}]")))
    }
}

/// The fields of a table, read one by one.
struct Fields {
    rest: vec::IntoIter<(String, Node)>,
    current: Option<(String, Node)>,
}

impl Fields {
    fn new(fields: Vec<(String, Node)>) -> Self {
        Self {
            rest: fields.into_iter(),
            current: None,
        }
    }
}

impl<'de> de::MapAccess<'de> for Fields {
    type Error = Located;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Located> {
        self.current = self.rest.next();
        self.current
            .as_ref()
            .map(|(key, _)| seed.deserialize(key.as_str().into_deserializer()))
            .transpose()
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Located> {
        let (key, node) = self
            .current
            .take()
            .expect("serde asks for a key before its value");
        seed.deserialize(node)
            .map_err(|error| error.within(cut(&key)))
    }
}
