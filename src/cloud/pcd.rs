//! PCD 0.6 and 0.7 (Point Cloud Library): ascii, binary, and binary_compressed (LZF, field by field). Little endian.

use super::fields::{FieldOffsets, Number, no_number, shown};
use super::lzf::{self, Fault};
use super::{Cloud, CloudError, Gathered, begins_with_number, holds_more, is_blank, more_than_announced};
use crate::geometry::DVec3;

struct Header {
    /// Name, type, and how many of them a point has.
    names: Vec<String>,
    numbers: Vec<Number>,
    counts: Vec<u64>,
    points: u64,
    data: String,
    body: usize,
    lines: usize,
}

/// What lies behind a header, and which of its fields are read.
struct PointData<'a> {
    file: &'a str,
    header: &'a Header,
    bytes: &'a [u8],
    offsets: FieldOffsets,
}

const MOST_HEADER_BYTES: usize = 1 << 16;

pub(super) fn read(file: &str, bytes: &[u8], label_field: Option<&str>) -> Result<Cloud, CloudError> {
    let header = Header::of(file, bytes)?;
    let offsets = FieldOffsets::of(file, "the line FIELDS", &header.names, label_field)?;
    let data = PointData { file, header: &header, bytes: &bytes[header.body..], offsets };
    match header.data.as_str() {
        "ascii" => data.ascii(),
        "binary" => data.binary(),
        "binary_compressed" => data.compressed(),
        other => Err(CloudError::NotSupported {
            file: file.into(),
            feature: format!("DATA {}", shown(other, 40)),
            cure: "write it as ascii, binary or binary_compressed (`pcl_convert_pcd_ascii_binary`)",
        }),
    }
}

fn malformed(file: &str, place: &str, reason: String) -> CloudError {
    CloudError::Malformed { file: file.into(), place: place.into(), reason }
}

impl Header {
    fn of(file: &str, bytes: &[u8]) -> Result<Header, CloudError> {
        let head = &bytes[..bytes.len().min(MOST_HEADER_BYTES)];
        let (mut names, mut sizes, mut kinds): (Vec<String>, Vec<String>, Vec<String>) = Default::default();
        let (mut counts, mut points, mut area): (Option<Vec<u64>>, Option<u64>, [Option<u64>; 2]) = Default::default();
        let mut body = 0;
        for (number, line) in head.split_inclusive(|&b| b == b'\n').enumerate() {
            body += line.len();
            let line = String::from_utf8_lossy(line);
            let fault = |reason: &str| malformed(file, &format!("header line {}", number + 1), reason.into());
            let words: Vec<&str> = line.split_whitespace().collect();
            let all = |words: &[&str]| words.iter().map(|word| (*word).to_string()).collect();
            let whole = |word: &str| word.parse::<u64>().map_err(|_| fault("not a whole number"));
            match words.as_slice() {
                [] | ["VERSION" | "VIEWPOINT", ..] => {}
                [word, ..] if word.starts_with('#') => {}
                ["FIELDS" | "COLUMNS", words @ ..] => names = all(words),
                ["SIZE", words @ ..] => sizes = all(words),
                ["TYPE", words @ ..] => kinds = all(words),
                ["COUNT", words @ ..] => counts = Some(words.iter().map(|w| whole(w)).collect::<Result<_, _>>()?),
                ["WIDTH", word] => area[0] = Some(whole(word)?),
                ["HEIGHT", word] => area[1] = Some(whole(word)?),
                ["POINTS", word] => points = Some(whole(word)?),
                ["DATA", data] => {
                    let counts = counts.unwrap_or_else(|| vec![1; names.len()]);
                    let fields = names.len();
                    if [sizes.len(), kinds.len(), counts.len()] != [fields; 3] {
                        return Err(fault("FIELDS, SIZE, TYPE and COUNT differ in length"));
                    }
                    let types = kinds.iter().zip(&sizes).map(|(kind, size)| number_type(kind, size));
                    let numbers = types.collect::<Option<_>>();
                    let numbers = numbers
                        .ok_or_else(|| fault("a TYPE and SIZE that do not exist (F 4, F 8, I or U 1, 2, 4, 8)"))?;
                    let by_area = area[0].zip(area[1]).and_then(|(w, h)| w.checked_mul(h));
                    let points = points.or(by_area).ok_or_else(|| fault("neither POINTS nor WIDTH and HEIGHT"))?;
                    let data = data.to_ascii_lowercase();
                    return Ok(Header { names, numbers, counts, points, data, body, lines: number + 1 });
                }
                _ if number == 0 => return Err(fault("not a PCD header; is it another format?")),
                _ => return Err(fault("not understood")),
            }
        }
        Err(malformed(file, "the header", "it has no line DATA: not PCD, or cut off; copy it again".into()))
    }

    /// Bytes of one point, if that is a number at all.
    fn point_size(&self) -> Option<u64> {
        let sizes = self.numbers.iter().zip(&self.counts);
        sizes
            .map(|(number, &count)| count.checked_mul(number.size() as u64))
            .try_fold(0u64, |sum, size| sum.checked_add(size?))
    }

    /// Bytes of all points, if so many are there and not a point more.
    fn check_size(&self, file: &str, data: &[u8]) -> Result<usize, CloudError> {
        let (size, there) = (self.point_size(), data.len() as u64);
        let needed = size.and_then(|size| size.checked_mul(self.points)).unwrap_or(u64::MAX);
        if needed > there {
            let place = format!("the data of {} points", self.points);
            return Err(CloudError::Truncated { file: file.into(), place, needed, there });
        }
        if size.is_some_and(|size| holds_more(&data[needed as usize..], size)) {
            return Err(more_than_announced(file, self.points));
        }
        Ok(needed as usize)
    }

    /// Where each field starts within a point, bytes; the sizes have been checked.
    fn offsets(&self) -> Vec<usize> {
        let mut at = 0;
        let next = |(number, &count): (&Number, &u64)| {
            let here = at;
            at += number.size() * count as usize;
            here
        };
        self.numbers.iter().zip(&self.counts).map(next).collect()
    }

    /// A field of no values has no place to read from, and points of no bytes could be as many as one likes.
    fn check_fields(&self, file: &str) -> Result<(), CloudError> {
        match self.counts.iter().position(|&count| count == 0) {
            Some(at) => {
                Err(malformed(file, "the line COUNT", format!("field '{}' has no values", shown(&self.names[at], 40))))
            }
            None => Ok(()),
        }
    }
}

impl PointData<'_> {
    fn ascii(&self) -> Result<Cloud, CloudError> {
        let PointData { file, header, .. } = *self;
        let mut gathered = self.gather()?;
        let text = String::from_utf8_lossy(self.bytes);
        let mut columns = Vec::new();
        let mut column = 0u64;
        for &count in &header.counts {
            columns.push(column);
            column = column.saturating_add(count);
        }
        let mut lines = text.lines().enumerate().filter(|(_, line)| !is_blank(line));
        let mut row = vec![f64::NAN; header.names.len()];
        for i in 0..header.points {
            let Some((number, line)) = lines.next() else {
                let reason = format!(
                    "the file ends where {} points were announced: it was cut off; copy it again",
                    header.points
                );
                return Err(malformed(file, &format!("point {i}"), reason));
            };
            let place = || format!("line {}", header.lines + number + 1);
            let (mut field, mut there) = (0, 0u64);
            for (k, word) in line.split_whitespace().enumerate() {
                there = k as u64 + 1;
                while field < columns.len() && columns[field] < k as u64 {
                    field += 1;
                }
                if columns.get(field) == Some(&(k as u64)) {
                    row[field] = word.parse().map_err(|_| malformed(file, &place(), no_number(word)))?;
                }
            }
            if there < column {
                return Err(malformed(file, &place(), format!("{there} values, a point has {column}")));
            }
            self.push(&mut gathered, |field| row[field]);
        }
        if lines.next().is_some_and(|(_, line)| begins_with_number(line)) {
            return Err(more_than_announced(file, header.points));
        }
        gathered.finish(file)
    }

    fn binary(&self) -> Result<Cloud, CloudError> {
        let PointData { file, header, bytes, .. } = *self;
        let size = header.check_size(file, bytes)?;
        let mut gathered = self.gather()?;
        let starts = header.offsets();
        let point_size = size / (header.points as usize).max(1);
        for i in 0..header.points as usize {
            self.push(&mut gathered, |field| header.numbers[field].take(bytes, i * point_size + starts[field], false));
        }
        gathered.finish(file)
    }

    /// Two sizes, then LZF; expanded, the values lie field after field.
    fn compressed(&self) -> Result<Cloud, CloudError> {
        let PointData { file, header, bytes, .. } = *self;
        let place = || "the compressed data".to_string();
        let sizes = bytes.get(..8).map(|head| [0, 4].map(|at| Number::U32.take(head, at, false) as usize));
        let Some([packed, unpacked]) = sizes else {
            return Err(CloudError::Truncated {
                file: file.into(),
                place: place(),
                needed: 8,
                there: bytes.len() as u64,
            });
        };
        let Some(input) = bytes[8..].get(..packed) else {
            let there = bytes.len() as u64 - 8;
            return Err(CloudError::Truncated { file: file.into(), place: place(), needed: packed as u64, there });
        };
        let expanded = lzf::expand(input, unpacked).map_err(|fault| {
            let reason = match fault {
                Fault::Ends { at } => format!("it ends within an instruction (byte {at})"),
                Fault::BeforeStart { at } => format!("it copies from before its start (byte {at})"),
                Fault::TooLong => format!("it expands to more than the {unpacked} bytes announced"),
                Fault::TooShort { made } => format!("it expands to {made} of the {unpacked} bytes announced"),
            };
            malformed(file, "the compressed data", format!("{reason}: the file is damaged; copy it again"))
        })?;
        header.check_size(file, &expanded)?;
        let mut gathered = self.gather()?;
        let points = header.points as usize;
        // A block a field: its points' values, `count` each.
        let starts: Vec<usize> = header.offsets().iter().map(|offset| offset * points).collect();
        for i in 0..points {
            self.push(&mut gathered, |field| {
                let stride = header.numbers[field].size() * header.counts[field] as usize;
                header.numbers[field].take(&expanded, starts[field] + i * stride, false)
            });
        }
        gathered.finish(file)
    }

    /// An empty cloud with the columns that the file has, once it is known that each field has a value to read.
    fn gather(&self) -> Result<Gathered, CloudError> {
        self.header.check_fields(self.file)?;
        Ok(Gathered::of(&self.offsets))
    }

    /// Adds one point, by the values of its fields.
    fn push(&self, gathered: &mut Gathered, value: impl Fn(usize) -> f64) {
        let [x, y, z] = self.offsets.xyz.map(&value);
        let of = |field: Option<usize>| field.map_or(f64::NAN, &value);
        gathered.push(DVec3::new(x, y, z), of(self.offsets.intensity), of(self.offsets.label));
    }
}

fn number_type(kind: &str, size: &str) -> Option<Number> {
    Some(match (kind, size) {
        ("F", "4") => Number::F32,
        ("F", "8") => Number::F64,
        ("I", "1") => Number::I8,
        ("I", "2") => Number::I16,
        ("I", "4") => Number::I32,
        ("I", "8") => Number::I64,
        ("U", "1") => Number::U8,
        ("U", "2") => Number::U16,
        ("U", "4") => Number::U32,
        ("U", "8") => Number::U64,
        _ => return None,
    })
}
