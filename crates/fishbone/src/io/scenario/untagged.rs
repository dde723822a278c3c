//! Fields of more than one possible type, read so that an error reports the value found and the types allowed.

use crate::scenario::{Component, Place, Rigidity, RigidityTable, SegmentSpec};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{
    self, Deserializer, IgnoredAny, MapAccess, Unexpected, Visitor, value::MapAccessDeserializer,
};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;

/// The integers of TOML and JSON are numbers too.
macro_rules! visit_integers_as_numbers {
    () => {
        fn visit_i64<E: de::Error>(self, value: i64) -> Result<Self::Value, E> {
            self.visit_f64(value as f64)
        }

        fn visit_u64<E: de::Error>(self, value: u64) -> Result<Self::Value, E> {
            self.visit_f64(value as f64)
        }
    };
}

impl<'de> Deserialize<'de> for Place {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PlaceVisitor;

        impl Visitor<'_> for PlaceVisitor {
            type Value = Place;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("\"start\", \"end\" or an arc length from the start")
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Place, E> {
                Ok(Place::ArcLength(value))
            }

            fn visit_str<E: de::Error>(self, word: &str) -> Result<Place, E> {
                match word {
                    "start" => Ok(Place::Start),
                    "end" => Ok(Place::End),
                    _ => Err(E::invalid_value(Unexpected::Str(word), &self)),
                }
            }

            visit_integers_as_numbers!();
        }

        deserializer.deserialize_any(PlaceVisitor)
    }
}

impl Serialize for Place {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Start => serializer.serialize_str("start"),
            Self::End => serializer.serialize_str("end"),
            Self::ArcLength(u) => serializer.serialize_f64(*u),
        }
    }
}

impl JsonSchema for Place {
    fn schema_name() -> Cow<'static, str> {
        "Place".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A place along the spine: an end, or an arc length from the start. Units: m.",
            "anyOf": [{ "enum": ["start", "end"] }, { "type": "number", "minimum": 0 }]
        })
    }
}

impl<'de> Deserialize<'de> for Component {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ComponentVisitor;

        impl Visitor<'_> for ComponentVisitor {
            type Value = Component;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or \"free\"")
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Component, E> {
                Ok(Component::Held(value))
            }

            fn visit_str<E: de::Error>(self, word: &str) -> Result<Component, E> {
                match word {
                    "free" => Ok(Component::Free),
                    _ => Err(E::invalid_value(Unexpected::Str(word), &self)),
                }
            }

            visit_integers_as_numbers!();
        }

        deserializer.deserialize_any(ComponentVisitor)
    }
}

impl Serialize for Component {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Held(value) => serializer.serialize_f64(*value),
            Self::Free => serializer.serialize_str("free"),
        }
    }
}

impl JsonSchema for Component {
    fn schema_name() -> Cow<'static, str> {
        "Component".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A coordinate, world axes, or free to move along that axis. Units: m.",
            "anyOf": [{ "type": "number" }, { "const": "free" }]
        })
    }
}

impl<'de> Deserialize<'de> for Rigidity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct RigidityVisitor;

        impl<'de> Visitor<'de> for RigidityVisitor {
            type Value = Rigidity;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number or a table { u = […], value = […] }")
            }

            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Rigidity, E> {
                Ok(Rigidity::Constant(value))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Rigidity, A::Error> {
                RigidityTable::deserialize(MapAccessDeserializer::new(map)).map(Rigidity::Table)
            }

            visit_integers_as_numbers!();
        }

        deserializer.deserialize_any(RigidityVisitor)
    }
}

impl Serialize for Rigidity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Constant(value) => serializer.serialize_f64(*value),
            Self::Table(table) => table.serialize(serializer),
        }
    }
}

impl JsonSchema for Rigidity {
    fn schema_name() -> Cow<'static, str> {
        "Rigidity".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = generator.subschema_for::<RigidityTable>();
        json_schema!({
            "description": "Flexural rigidity: one number, or a table along the segment. Units: N·m².",
            "anyOf": [{ "type": "number", "exclusiveMinimum": 0 }, table]
        })
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum SegmentKind {
    Straight,
    Arc,
    Corner,
    Rigid,
}

impl SegmentKind {
    fn fields(&self) -> &'static [&'static str] {
        match self {
            Self::Straight => &["kind", "length", "natural_bend", "rigidity"],
            Self::Arc => &["kind", "length", "curvature", "natural_bend", "rigidity"],
            Self::Corner => &["kind", "angle"],
            Self::Rigid => &["kind", "length"],
        }
    }
}

/// The fields of a segment of any kind. Serde's own reading of a tagged enum loses the path of a field at fault, and the
/// allowed fields are known only once the kind is known.
#[derive(Default)]
struct SegmentFields {
    kind: Option<SegmentKind>,
    length: Option<f64>,
    curvature: Option<f64>,
    angle: Option<f64>,
    natural_bend: Option<f64>,
    rigidity: Option<Rigidity>,
    names: Vec<String>,
}

impl SegmentFields {
    fn read<'de, A: MapAccess<'de>>(&mut self, name: String, map: &mut A) -> Result<(), A::Error> {
        match name.as_str() {
            "kind" => self.kind = Some(map.next_value()?),
            "length" => self.length = map.next_value()?,
            "curvature" => self.curvature = map.next_value()?,
            "angle" => self.angle = map.next_value()?,
            "natural_bend" => self.natural_bend = map.next_value()?,
            "rigidity" => self.rigidity = map.next_value()?,
            _ => drop(map.next_value::<IgnoredAny>()?),
        }
        self.names.push(name);
        Ok(())
    }

    fn into_spec<E: de::Error>(self) -> Result<SegmentSpec, E> {
        let kind = self.kind.ok_or_else(|| E::missing_field("kind"))?;
        let allowed = kind.fields();
        if let Some(name) = self
            .names
            .iter()
            .find(|name| !allowed.contains(&name.as_str()))
        {
            return Err(E::unknown_field(name, allowed));
        }
        let length = self.length.ok_or_else(|| E::missing_field("length"));
        Ok(match kind {
            SegmentKind::Straight => SegmentSpec::Straight {
                length: length?,
                natural_bend: self.natural_bend,
                rigidity: self.rigidity,
            },
            SegmentKind::Arc => SegmentSpec::Arc {
                length: length?,
                curvature: self
                    .curvature
                    .ok_or_else(|| E::missing_field("curvature"))?,
                natural_bend: self.natural_bend,
                rigidity: self.rigidity,
            },
            SegmentKind::Corner => SegmentSpec::Corner {
                angle: self.angle.ok_or_else(|| E::missing_field("angle"))?,
            },
            SegmentKind::Rigid => SegmentSpec::Rigid { length: length? },
        })
    }
}

impl<'de> Deserialize<'de> for SegmentSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct SegmentVisitor;

        impl<'de> Visitor<'de> for SegmentVisitor {
            type Value = SegmentSpec;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a table")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SegmentSpec, A::Error> {
                let mut fields = SegmentFields::default();
                while let Some(name) = map.next_key()? {
                    fields.read(name, &mut map)?;
                }
                fields.into_spec()
            }
        }

        deserializer.deserialize_any(SegmentVisitor)
    }
}
