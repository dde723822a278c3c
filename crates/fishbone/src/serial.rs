//! How serde writes and reads fields of types that it does not know.

use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A list that has to be empty, as its entries cannot be stored.
pub(crate) mod none {
    use super::*;

    pub(crate) fn serialize<T, S: Serializer>(
        list: &[T],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match list.is_empty() {
            true => ().serialize(serializer),
            false => Err(S::Error::custom("obstacles of the caller's own")),
        }
    }

    pub(crate) fn deserialize<'de, T, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<T>, D::Error> {
        <()>::deserialize(deserializer)?;
        Ok(Vec::new())
    }
}

/// A list of arrays, entry by entry: serde knows no arrays of any length.
pub(crate) mod arrays {
    use super::*;

    pub(crate) fn serialize<T: Serialize, const N: usize, S: Serializer>(
        list: &[[T; N]],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(list.as_flattened())
    }

    pub(crate) fn deserialize<'de, T: Deserialize<'de> + Copy, const N: usize, D>(
        deserializer: D,
    ) -> Result<Vec<[T; N]>, D::Error>
    where
        D: Deserializer<'de>,
    {
        let entries: Vec<T> = Deserialize::deserialize(deserializer)?;
        let (arrays, rest) = entries.as_chunks();
        match rest.is_empty() {
            true => Ok(arrays.to_vec()),
            false => Err(D::Error::custom("an array with entries missing")),
        }
    }
}

/// A value that may not have been found yet.
pub(crate) mod once {
    use super::*;
    use std::sync::OnceLock;

    pub(crate) fn serialize<T: Serialize, S: Serializer>(
        value: &OnceLock<T>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        value.get().serialize(serializer)
    }

    pub(crate) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<OnceLock<T>, D::Error> {
        let value: Option<T> = Deserialize::deserialize(deserializer)?;
        Ok(value.map_or_else(OnceLock::new, OnceLock::from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_list_of_obstacles_is_stored_only_if_it_is_empty() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Obstacles(#[serde(with = "none")] Vec<std::ops::RangeFull>);
        assert!(postcard::to_stdvec(&Obstacles(vec![..])).is_err());
        let stored = postcard::to_stdvec(&Obstacles(Vec::new())).unwrap();
        assert_eq!(postcard::from_bytes(&stored), Ok(Obstacles(Vec::new())));
    }

    #[test]
    fn test_arrays_and_values_not_yet_found_read_back() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Fields {
            #[serde(with = "arrays")]
            rows: Vec<[Option<f64>; 3]>,
            #[serde(with = "once")]
            found: std::sync::OnceLock<u8>,
        }
        for found in [std::sync::OnceLock::new(), 7.into()] {
            let rows = vec![[None, Some(1.5), None], [Some(-0.0); 3]];
            let fields = Fields { rows, found };
            let stored = postcard::to_stdvec(&fields).unwrap();
            assert_eq!(postcard::from_bytes(&stored), Ok(fields));
        }
    }
}
