//! Valid bytes -> hostile bytes: what a broken disk, a careless editor or an attacker leaves.

use std::ops::Range;

use proptest::prelude::*;
use proptest::sample::select;

/// A place: a share of what is there when its turn comes, in 2^32nds.
#[derive(Clone, Copy, Debug)]
pub struct Share(pub u32);

impl Share {
    fn index(self, length: usize) -> usize {
        ((self.0 as u64 * length as u64) >> 32) as usize
    }
}

/// One change.
#[derive(Clone, Debug)]
pub enum Edit {
    Flip {
        at: Share,
        bit: u8,
    },
    Cut {
        at: Share,
    },
    Remove {
        at: Share,
        length: usize,
    },
    Repeat {
        at: Share,
        length: usize,
        times: usize,
    },
    Move {
        from: Share,
        to: Share,
        length: usize,
    },
    /// A number of `size` bytes, little endian, over what is there.
    Word {
        at: Share,
        value: u64,
        size: usize,
    },
    /// Another text for a number that is written in digits.
    Digits {
        which: Share,
        text: &'static str,
    },
    Insert {
        at: Share,
        bytes: Vec<u8>,
    },
}

const WORDS: [u64; 12] =
    [0, 1, 127, 128, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 1 << 40, 1 << 62, u64::MAX / 2, u64::MAX];
const DIGITS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "255",
    "65536",
    "2147483647",
    "2147483648",
    "4294967296",
    "1000000000",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999999",
    "1e308",
    "1e-320",
    "nan",
    "-inf",
];

/// What means something in JSON.
pub const JSON: &[&str] =
    &["{", "}", "[", "]", ",", ":", "null", "true", "\"", "\\u0000", "-1", "1e999", "\n", "18446744073709551615"];

/// Up to eight changes; `tokens` mean something in the format.
pub fn edits(tokens: &[&'static str]) -> impl Strategy<Value = Vec<Edit>> + use<> {
    let at = || any::<u32>().prop_map(Share);
    let token = prop_oneof![
        6 => select(tokens.to_vec()).prop_map(|token| token.as_bytes().to_vec()),
        1 => prop::collection::vec(any::<u8>(), 1..20),
        // No UTF-8; a byte order mark; a text without end.
        1 => select(vec![vec![0xff, 0xfe], vec![0xc3, 0x28], vec![0xef, 0xbb, 0xbf], vec![b'a'; 5000], vec![b'['; 300]]),
    ];
    let edit = prop_oneof![
        3 => (at(), 0..8u8).prop_map(|(at, bit)| Edit::Flip { at, bit }),
        1 => at().prop_map(|at| Edit::Cut { at }),
        2 => (at(), 1..60usize).prop_map(|(at, length)| Edit::Remove { at, length }),
        2 => (at(), 1..60usize, 1..8usize).prop_map(|(at, length, times)| Edit::Repeat { at, length, times }),
        2 => (at(), at(), 1..60usize).prop_map(|(from, to, length)| Edit::Move { from, to, length }),
        3 => (at(), select(&WORDS[..]), select(vec![1, 2, 4, 8]))
            .prop_map(|(at, value, size)| Edit::Word { at, value, size }),
        4 => (at(), select(&DIGITS[..])).prop_map(|(which, text)| Edit::Digits { which, text }),
        4 => (at(), token).prop_map(|(at, bytes)| Edit::Insert { at, bytes }),
    ];
    prop::collection::vec(edit, 1..8)
}

pub fn apply(bytes: &[u8], edits: &[Edit]) -> Vec<u8> {
    edits.iter().fold(bytes.to_vec(), changed)
}

fn changed(mut bytes: Vec<u8>, edit: &Edit) -> Vec<u8> {
    if bytes.is_empty() {
        return bytes;
    }
    let piece = |at: &Share, length: usize| -> Range<usize> {
        let start = at.index(bytes.len());
        start..(start + length).min(bytes.len())
    };
    match edit {
        Edit::Flip { at, bit } => {
            let at = at.index(bytes.len());
            bytes[at] ^= 1 << bit;
        }
        Edit::Cut { at } => bytes.truncate(at.index(bytes.len())),
        Edit::Remove { at, length } => drop(bytes.drain(piece(at, *length))),
        Edit::Repeat { at, length, times } => {
            let piece = piece(at, *length);
            let more = bytes[piece.clone()].repeat(*times);
            bytes.splice(piece.end..piece.end, more);
        }
        Edit::Move { from, to, length } => {
            let taken: Vec<u8> = bytes.drain(piece(from, *length)).collect();
            let to = to.index(bytes.len() + 1);
            bytes.splice(to..to, taken);
        }
        Edit::Word { at, value, size } => {
            let piece = piece(at, *size);
            let word = &value.to_le_bytes()[..piece.len()];
            bytes[piece].copy_from_slice(word);
        }
        Edit::Digits { which, text } => {
            let starts: Vec<usize> = (0..bytes.len())
                .filter(|&i| bytes[i].is_ascii_digit() && (i == 0 || !bytes[i - 1].is_ascii_digit()))
                .collect();
            if !starts.is_empty() {
                let start = starts[which.index(starts.len())];
                let end = start + bytes[start..].iter().take_while(|byte| byte.is_ascii_digit()).count();
                bytes.splice(start..end, text.bytes());
            }
        }
        Edit::Insert { at, bytes: more } => {
            let at = at.index(bytes.len() + 1);
            bytes.splice(at..at, more.iter().copied());
        }
    }
    bytes
}

/// So many cases, or as many as `PROPTEST_CASES` says.
pub fn cases(few: u32) -> ProptestConfig {
    let told = std::env::var("PROPTEST_CASES").is_ok();
    let default = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    if told { default } else { ProptestConfig { cases: few, ..default } }
}
