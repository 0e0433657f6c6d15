//! A filter's arrays <-> bytes by name.

use super::lanes::Real;
use super::{FilterError, FilterState};

/// Collects arrays.
pub(crate) struct Writer(FilterState);

/// Looks arrays up.
pub(crate) struct Reader<'a>(&'a FilterState);

impl Writer {
    pub(super) fn new(kind: &str) -> Writer {
        Writer(FilterState { kind: kind.to_string(), arrays: Vec::new() })
    }

    pub(crate) fn reals<T: Real>(&mut self, name: &str, values: impl Iterator<Item = T>) {
        let mut bytes = Vec::new();
        values.for_each(|value| value.write_le(&mut bytes));
        let count = bytes.len() / size_of::<T>();
        self.0.arrays.push((name.to_string(), T::NAME, vec![count], bytes));
    }

    pub(super) fn counts(&mut self, name: &str, values: impl Iterator<Item = u64>) {
        let bytes: Vec<u8> = values.flat_map(u64::to_le_bytes).collect();
        self.0.arrays.push((name.to_string(), "U64", vec![bytes.len() / 8], bytes));
    }

    pub(super) fn finish(self) -> FilterState {
        self.0
    }
}

impl<'a> Reader<'a> {
    pub(super) fn new(state: &'a FilterState, kind: &str) -> Result<Reader<'a>, FilterError> {
        if state.kind == kind {
            Ok(Reader(state))
        } else {
            Err(FilterError::OtherKind { there: state.kind.clone(), here: kind.to_string() })
        }
    }

    /// Whether there is such an array, of whatever size and type.
    pub(super) fn holds(&self, name: &str) -> bool {
        self.0.arrays.iter().any(|a| a.0 == name)
    }

    /// The bytes of `count` values of a type; a missing array and one of another type hold none.
    fn bytes(&self, name: &str, dtype: &str, count: usize, size: usize) -> Result<&'a [u8], FilterError> {
        let array = self.0.arrays.iter().find(|a| a.0 == name && a.1 == dtype);
        let bytes = array.map_or(&[][..], |a| &a.3);
        if bytes.len() == count * size {
            Ok(bytes)
        } else {
            Err(FilterError::OtherSize { there: bytes.len() / size, here: count })
        }
    }

    pub(crate) fn reals<T: Real>(&self, name: &str, count: usize) -> Result<Vec<T>, FilterError> {
        let bytes = self.bytes(name, T::NAME, count, size_of::<T>())?;
        Ok(bytes.chunks_exact(size_of::<T>()).map(T::read_le).collect())
    }

    pub(super) fn counts(&self, name: &str, count: usize) -> Result<Vec<u64>, FilterError> {
        let bytes = self.bytes(name, "U64", count, 8)?;
        Ok(bytes.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b)).collect())
    }
}
