//! Which graphics adapter a scene means.

use std::fmt;

use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

/// A graphics adapter by its number in `yawara devices` or by a part of its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Adapter {
    /// Its number.
    Index(usize),
    /// A part of its name, in upper or lower case, that no other adapter's name has.
    Name(String),
}

/// Prints the number, or the name in quotation marks.
impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => write!(f, "{name:?}"),
        }
    }
}

impl Serialize for Adapter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Index(index) => index.serialize(serializer),
            Self::Name(name) => name.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Adapter {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberOrName)
    }
}

struct NumberOrName;

impl Visitor<'_> for NumberOrName {
    type Value = Adapter;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an adapter's number in `yawara devices` or a part of its name")
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Adapter, E> {
        let wrong = |_| E::invalid_value(de::Unexpected::Signed(number), &self);
        usize::try_from(number).map(Adapter::Index).map_err(wrong)
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<Adapter, E> {
        let wrong = |_| E::invalid_value(de::Unexpected::Unsigned(number), &self);
        usize::try_from(number).map(Adapter::Index).map_err(wrong)
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<Adapter, E> {
        Ok(Adapter::Name(name.to_owned()))
    }
}
