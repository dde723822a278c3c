//! Stored results: equilibria, trackers and diagrams as bytes, exact to the bit, for the same version of fishbone.

use crate::analysis::continuation::Diagram;
use crate::analysis::path::{NoPath, Path, Poses};
use crate::analysis::tracking::Tracker;
use crate::equilibrium::Equilibrium;
use crate::io::path::{Number, Numbers};
use crate::problem::Problem;
use crate::scenario::Scenario;
use nalgebra::Vector3;
use serde::de::{DeserializeOwned, Error as _};
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::any::Any;
use thiserror::Error;

/// First bytes of everything stored.
const MAGIC: &str = "fishbone";

/// The version whose results can be read: this one.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The reason why a result cannot be stored, or bytes hold none.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NotStored {
    /// The bytes hold something else, or are damaged.
    #[error("found bytes that hold no {0}, allowed those of a stored one")]
    Unreadable(&'static str),
    /// Another version has stored the result.
    #[error("found a {kind} of version {found}, allowed one of version {VERSION}")]
    OtherVersion {
        /// What is stored.
        kind: &'static str,
        /// The version that has stored it.
        found: String,
    },
    /// The problem or its path has a part of the caller's own.
    #[error(
        "found a {0} with an obstacle or a path of the caller's own, allowed one of a scenario"
    )]
    OfCallersOwn(&'static str),
}

/// A result that can be stored.
pub trait Stored: Serialize + DeserializeOwned {
    /// What it is, a word.
    const KIND: &'static str;

    /// The result as bytes.
    ///
    /// # Errors
    ///
    /// [`NotStored::OfCallersOwn`].
    fn to_bytes(&self) -> Result<Vec<u8>, NotStored> {
        let mut bytes =
            postcard::to_stdvec(&[MAGIC, Self::KIND, VERSION]).expect("words can be written");
        let content = postcard::to_stdvec(self);
        let content = content.map_err(|_| NotStored::OfCallersOwn(Self::KIND))?;
        bytes.extend(checksum(&content).to_le_bytes());
        bytes.extend(content);
        Ok(bytes)
    }

    /// The result of bytes.
    ///
    /// # Errors
    ///
    /// [`NotStored`] of bytes that hold another kind of result, are of another version, or have been changed.
    fn from_bytes(bytes: &[u8]) -> Result<Self, NotStored> {
        let unreadable = || NotStored::Unreadable(Self::KIND);
        let (words, rest): ([&str; 3], _) =
            postcard::take_from_bytes(bytes).map_err(|_| unreadable())?;
        let [magic, kind, version] = words;
        if magic != MAGIC || kind != Self::KIND {
            return Err(unreadable());
        }
        if version != VERSION {
            return Err(NotStored::OtherVersion {
                kind: Self::KIND,
                found: version.to_owned(),
            });
        }
        let (sum, content) = rest.split_first_chunk().ok_or_else(unreadable)?;
        if u64::from_le_bytes(*sum) != checksum(content) {
            return Err(unreadable());
        }
        postcard::from_bytes(content).map_err(|_| unreadable())
    }
}

impl Stored for Equilibrium {
    const KIND: &'static str = "equilibrium";
}

impl Stored for Diagram {
    const KIND: &'static str = "diagram";
}

impl Stored for Tracker {
    const KIND: &'static str = "tracker";
}

/// A sum by which bytes that have been changed are recognised.
///
/// Source: the hash FNV-1a of 64 bits.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// A problem is made anew of its scenario: numbers in text are exact.
impl Serialize for Problem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.scenario().to_json(), self.origin()).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Problem {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (text, origin): (String, Vector3<f64>) = Deserialize::deserialize(deserializer)?;
        let scenario = Scenario::from_json(&text).map_err(D::Error::custom)?;
        let problem = Problem::new(scenario).map_err(D::Error::custom)?;
        Ok(problem.about(origin))
    }
}

/// A change of a problem that can be stored.
#[derive(Serialize, Deserialize)]
enum StoredChange<P, N> {
    Poses(P),
    Numbers(N),
}

impl Serialize for Path {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let change: &dyn Any = self.change();
        let change = match (change.downcast_ref(), change.downcast_ref()) {
            (Some(poses), _) => StoredChange::<&Poses, &Vec<Number>>::Poses(poses),
            (None, Some(Numbers { numbers, .. })) => StoredChange::Numbers(numbers),
            (None, None) => return Err(S::Error::custom("a change of the caller's own")),
        };
        (self.base(), change).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Path {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (base, change): (_, StoredChange<Poses, _>) = Deserialize::deserialize(deserializer)?;
        let path = match change {
            StoredChange::Poses(poses) => Path::new(&base, poses),
            StoredChange::Numbers(numbers) => Path::new(&base, Numbers::of(&base, numbers)),
        };
        path.map_err(|refused: NoPath| D::Error::custom(refused))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{BeltSpec, SegmentSpec};

    fn problem() -> Problem {
        let segments = vec![SegmentSpec::straight(1.0)];
        Problem::new(Scenario::new(BeltSpec::new(0.1, 1.0, segments))).unwrap()
    }

    /// A change that no scenario names.
    #[derive(Debug)]
    struct Own;

    impl crate::analysis::path::Change for Own {
        fn problem(&self, base: &Problem, _: f64) -> Result<Problem, NoPath> {
            Ok(base.clone())
        }
    }

    #[test]
    fn test_path_of_the_callers_own_is_not_stored() {
        let own = Path::new(&problem(), Own).unwrap();
        assert!(postcard::to_stdvec(&own).is_err());
        let numbers = Path::numbers(&problem(), &[("belt.width".to_owned(), 0.2)]).unwrap();
        let stored = postcard::to_stdvec(&numbers).unwrap();
        let again: Path = postcard::from_bytes(&stored).unwrap();
        assert_eq!(again.at(0.5), numbers.at(0.5));
    }

    #[test]
    fn test_problem_keeps_its_origin() {
        let problem = problem().about(Vector3::new(0.1, 1.0 / 3.0, f64::MIN_POSITIVE));
        let stored = postcard::to_stdvec(&problem).unwrap();
        assert_eq!(postcard::from_bytes::<Problem>(&stored).unwrap(), problem);
    }

    #[test]
    fn test_checksum_is_that_of_its_source() {
        assert_eq!(checksum(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(checksum(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
