//! Keyed: parts of a study, each under its key, so that one that arrives twice counts once.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt;

use super::aggregate::Aggregate;

/// Values by key. Merging is associative, commutative and idempotent.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Keyed<K, V> {
    parts: BTreeMap<K, V>,
}

/// Two different values under one key: they are not of one study.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{0} has two different results; they come from different versions or scenarios and cannot be joined")]
pub struct Conflict<K: fmt::Display>(pub K);

impl<K, V> Default for Keyed<K, V> {
    fn default() -> Self {
        Self { parts: BTreeMap::new() }
    }
}

impl<K: Ord + Copy + fmt::Display, V: Eq + Clone> Keyed<K, V> {
    /// Puts `value` under `key`; whether it is new.
    ///
    /// # Errors
    /// If there is another value under `key`.
    pub fn insert(&mut self, key: K, value: V) -> Result<bool, Conflict<K>> {
        match self.parts.entry(key) {
            Entry::Vacant(free) => {
                free.insert(value);
                Ok(true)
            }
            Entry::Occupied(taken) if *taken.get() == value => Ok(false),
            Entry::Occupied(_) => Err(Conflict(key)),
        }
    }
    /// Takes in all parts of `other`.
    ///
    /// # Errors
    /// The first key under which both have different values; nothing was taken in then.
    pub fn merge(&mut self, other: &Self) -> Result<(), Conflict<K>> {
        for (key, value) in &other.parts {
            if self.parts.get(key).is_some_and(|mine| mine != value) {
                return Err(Conflict(*key));
            }
        }
        self.parts.extend(other.parts.iter().map(|(key, value)| (*key, value.clone())));
        Ok(())
    }
    /// The value under `key`.
    pub fn get(&self, key: K) -> Option<&V> {
        self.parts.get(&key)
    }
    /// Number of keys.
    pub fn len(&self) -> usize {
        self.parts.len()
    }
    /// Whether there is no key.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }
    /// All parts, in the order of their keys.
    pub fn iter(&self) -> impl Iterator<Item = (K, &V)> {
        self.parts.iter().map(|(key, value)| (*key, value))
    }
}

impl<K> Keyed<K, Aggregate> {
    /// All parts together.
    pub fn total(&self) -> Aggregate {
        self.parts.values().fold(Aggregate::default(), |mut total, part| {
            total.merge(part);
            total
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_that_arrives_twice_counts_once_and_another_is_refused() {
        let mut all = Keyed::default();
        assert_eq!((all.insert(7, 1), all.insert(7, 1), all.insert(8, 2)), (Ok(true), Ok(false), Ok(true)));
        let refused = all.insert(8, 3).unwrap_err();
        assert!(refused.to_string().starts_with("8 has two different results"));
        let mut other = Keyed::default();
        other.insert(6, 0).unwrap();
        other.insert(8, 3).unwrap();
        let before = all.clone();
        assert_eq!(all.merge(&other), Err(Conflict(8)));
        assert_eq!(all, before, "nothing was taken in");
        assert_eq!(all.iter().collect::<Vec<_>>(), [(7, &1), (8, &2)]);
    }
}
