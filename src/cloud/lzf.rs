//! LZF, the compression of `binary_compressed` PCD files (Lehmann's liblzf).
//!
//! A control byte below 32 is followed by that many plus one literal bytes; else its upper three bits plus two (7: plus the next
//! byte) are the length of a copy, its lower five bits and one more byte the distance back, less one. A copy may overlap what it
//! makes. Three bytes give 264 at most, so what is made is at most 88 times what is read.

/// Why the bytes are not LZF, or not of the size announced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// The input ends within an instruction, at this byte.
    Ends { at: usize },
    /// A copy from before the start, at this byte.
    BeforeStart { at: usize },
    /// More comes out than was announced.
    TooLong,
    /// Less comes out than was announced.
    TooShort { made: usize },
}

/// The greatest factor by which anything can expand.
const MOST_EXPANSION: usize = 88;

/// Exactly `size` bytes out of `input`.
pub(super) fn expand(input: &[u8], size: usize) -> Result<Vec<u8>, Fault> {
    if size > input.len().saturating_mul(MOST_EXPANSION) {
        return Err(Fault::TooShort { made: 0 });
    }
    let mut out: Vec<u8> = Vec::with_capacity(size);
    let mut at = 0;
    let byte = |at: usize| input.get(at).map(|&b| usize::from(b)).ok_or(Fault::Ends { at });
    while at < input.len() {
        let control = byte(at)?;
        at += 1;
        if control < 32 {
            let literal = input.get(at..at + control + 1).ok_or(Fault::Ends { at })?;
            if out.len() + literal.len() > size {
                return Err(Fault::TooLong);
            }
            out.extend_from_slice(literal);
            at += control + 1;
            continue;
        }
        let mut length = (control >> 5) + 2;
        if control >> 5 == 7 {
            length += byte(at)?;
            at += 1;
        }
        let back = ((control & 31) << 8 | byte(at)?) + 1;
        at += 1;
        if out.len() + length > size {
            return Err(Fault::TooLong);
        }
        let from = out.len().checked_sub(back).ok_or(Fault::BeforeStart { at })?;
        (from..from + length).for_each(|i| out.push(out[i]));
    }
    if out.len() == size { Ok(out) } else { Err(Fault::TooShort { made: out.len() }) }
}

/// The same bytes, shorter where triples repeat within 8 KiB.
#[cfg(test)]
pub(super) fn squeeze(input: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut recent = std::collections::BTreeMap::new();
    let (mut at, mut literal) = (0, 0);
    let flush = |out: &mut Vec<u8>, bytes: &[u8]| {
        for part in bytes.chunks(32) {
            out.push(part.len() as u8 - 1);
            out.extend_from_slice(part);
        }
    };
    while at < input.len() {
        let triple = input.get(at..at + 3);
        let found = triple.and_then(|t| recent.insert(t.to_vec(), at)).filter(|&from| at - from <= 8192);
        let Some(from) = found else {
            at += 1;
            continue;
        };
        let same = (0..264.min(input.len() - at)).take_while(|&k| input[from + k] == input[at + k]).count();
        flush(&mut out, &input[literal..at]);
        let (length, back) = (same - 2, at - from - 1);
        if length < 7 {
            out.push((length << 5 | back >> 8) as u8);
        } else {
            out.extend([(7 << 5 | back >> 8) as u8, (length - 7) as u8]);
        }
        out.push(back as u8);
        at += same;
        literal = at;
    }
    flush(&mut out, &input[literal..]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn exact_a_copy_may_overlap_itself() {
        // "ab", then 7 + 2 bytes from 2 back: ababababab a.
        assert_eq!(expand(&[1, b'a', b'b', 7 << 5, 0, 1], 11), Ok(b"abababababa".to_vec()));
    }

    #[test]
    fn extreme_bad_instructions_are_told_apart() {
        assert_eq!(expand(&[5, 1, 2], 6), Err(Fault::Ends { at: 1 }));
        assert_eq!(expand(&[0, 1, 1 << 5, 9], 4), Err(Fault::BeforeStart { at: 4 }));
        assert_eq!(expand(&[1, 1, 2], 1), Err(Fault::TooLong));
        assert_eq!(expand(&[0, 1], 2), Err(Fault::TooShort { made: 1 }));
        assert_eq!(expand(&[0; 10], usize::MAX), Err(Fault::TooShort { made: 0 }));
    }

    proptest! {
        #[test]
        fn equal_what_is_squeezed_expands_to_itself(
            bytes in prop::collection::vec(prop_oneof![9 => 0u8..3, 1 => any::<u8>()], 0..5000),
        ) {
            prop_assert_eq!(expand(&squeeze(&bytes), bytes.len()), Ok(bytes));
        }

        #[test]
        fn extreme_any_bytes_end_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), size in 0usize..30_000) {
            if let Ok(out) = expand(&bytes, size) {
                prop_assert_eq!(out.len(), size);
            }
        }
    }
}
