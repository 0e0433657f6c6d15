//! PLY (Turk 1994): ascii, binary little and big endian; the element `vertex`, lists in it skipped.

use super::fields::{FieldOffsets, Number, no_number};
use super::{Cloud, CloudError, Gathered, begins_with_number, holds_more, is_blank, more_than_announced};
use crate::geometry::DVec3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Binary { big_endian: bool },
}

#[derive(Clone, Debug)]
enum Property {
    One { name: String, number: Number },
    List { count: Number, item: Number },
}

#[derive(Clone, Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Bytes of one; `None` where it holds a list.
    fn fixed_size(&self) -> Option<u64> {
        self.properties.iter().try_fold(0u64, |sum, property| match property {
            Property::One { number, .. } => Some(sum + number.size() as u64),
            Property::List { .. } => None,
        })
    }
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// First byte behind it.
    body: usize,
    lines: usize,
}

/// A header is text of some hundred bytes; a file that has none is not searched further.
const MOST_HEADER_BYTES: usize = 1 << 16;

pub(super) fn read(file: &str, bytes: &[u8], label_field: Option<&str>) -> Result<Cloud, CloudError> {
    let header = Header::of(file, bytes)?;
    let Some(at) = header.elements.iter().position(|element| element.name == "vertex") else {
        return Err(malformed(file, "the header", "there is no element 'vertex'".into()));
    };
    let vertex = &header.elements[at];
    // Lists have no name here: they hold no coordinate.
    let name = |property: &Property| match property {
        Property::One { name, .. } => name.clone(),
        Property::List { .. } => String::new(),
    };
    let names: Vec<String> = vertex.properties.iter().map(name).collect();
    let places = FieldOffsets::of(file, "the element 'vertex'", &names, label_field)?;
    let mut gathered = Gathered::of(&places);
    let body = &bytes[header.body..];
    // Of elements that stand behind the vertices nothing is read.
    let is_last = at + 1 == header.elements.len();
    match header.encoding {
        Encoding::Ascii => {
            let skipped = header.elements[..at].iter().fold(0u64, |sum, element| sum.saturating_add(element.count));
            read_ascii(file, body, header.lines, skipped, (vertex, is_last), &places, &mut gathered)?;
        }
        Encoding::Binary { big_endian } => {
            let mut reader = Binary { file, body, at: 0, big_endian };
            let mut row = vec![f64::NAN; vertex.properties.len()];
            for element in &header.elements[..at] {
                reader.skip(element)?;
            }
            for i in 0..vertex.count {
                reader.row(vertex, i, &mut row)?;
                push(&mut gathered, &places, &row);
            }
            if is_last && vertex.fixed_size().is_some_and(|size| holds_more(&body[reader.at..], size)) {
                return Err(more_than_announced(file, vertex.count));
            }
        }
    }
    gathered.finish(file)
}

fn push(gathered: &mut Gathered, places: &FieldOffsets, row: &[f64]) {
    let [x, y, z] = places.xyz.map(|place| row[place]);
    let value = |place: Option<usize>| place.map_or(f64::NAN, |place| row[place]);
    gathered.push(DVec3::new(x, y, z), value(places.intensity), value(places.label));
}

fn malformed(file: &str, place: &str, reason: String) -> CloudError {
    CloudError::Malformed { file: file.into(), place: place.into(), reason }
}

impl Header {
    fn of(file: &str, bytes: &[u8]) -> Result<Header, CloudError> {
        let head = &bytes[..bytes.len().min(MOST_HEADER_BYTES)];
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut body = 0;
        for (number, line) in head.split_inclusive(|&b| b == b'\n').enumerate() {
            body += line.len();
            let line = String::from_utf8_lossy(line);
            let words: Vec<&str> = line.split_whitespace().collect();
            let fault = |reason: &str| malformed(file, &format!("header line {}", number + 1), reason.into());
            match words.as_slice() {
                ["ply"] if number == 0 => {}
                _ if number == 0 => return Err(fault("a PLY file starts with 'ply'; is it another format?")),
                ["format", name, ..] => {
                    encoding = Some(match *name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::Binary { big_endian: false },
                        "binary_big_endian" => Encoding::Binary { big_endian: true },
                        _ => return Err(fault("the format is none of ascii, binary_little_endian, binary_big_endian")),
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| fault("the count is not a whole number"))?;
                    elements.push(Element { name: (*name).into(), count, properties: Vec::new() });
                }
                ["property", "list", count, item, _] => {
                    let of = |name: &str| number_type(name).ok_or_else(|| fault("an unknown type"));
                    let property = Property::List { count: of(count)?, item: of(item)? };
                    elements
                        .last_mut()
                        .ok_or_else(|| fault("a property before any element"))?
                        .properties
                        .push(property);
                }
                ["property", kind, name] => {
                    let number = number_type(kind).ok_or_else(|| fault("an unknown type"))?;
                    let property = Property::One { name: (*name).into(), number };
                    elements
                        .last_mut()
                        .ok_or_else(|| fault("a property before any element"))?
                        .properties
                        .push(property);
                }
                ["end_header"] => {
                    let encoding = encoding.ok_or_else(|| fault("there is no line 'format'"))?;
                    return Ok(Header { encoding, elements, body, lines: number + 1 });
                }
                ["comment" | "obj_info", ..] | [] => {}
                _ => return Err(fault("not understood")),
            }
        }
        Err(malformed(file, "the header", "it has no line 'end_header': not PLY, or cut off; copy it again".into()))
    }
}

fn number_type(name: &str) -> Option<Number> {
    Some(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "long" | "int64" => Number::I64,
        "ulong" | "uint64" => Number::U64,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}

/// Rows of text, one a line.
fn read_ascii(
    file: &str,
    body: &[u8],
    header_lines: usize,
    skipped: u64,
    (vertex, is_last): (&Element, bool),
    places: &FieldOffsets,
    gathered: &mut Gathered,
) -> Result<(), CloudError> {
    let text = String::from_utf8_lossy(body);
    let mut lines = text.lines().enumerate().filter(|(_, line)| !is_blank(line));
    for _ in 0..skipped {
        if lines.next().is_none() {
            break;
        }
    }
    let mut row = vec![f64::NAN; vertex.properties.len()];
    for i in 0..vertex.count {
        let Some((number, line)) = lines.next() else {
            return Err(malformed(
                file,
                &format!("vertex {i}"),
                format!("the file ends where {} vertices were announced: it was cut off; copy it again", vertex.count),
            ));
        };
        let fault = |reason: String| malformed(file, &format!("line {}", header_lines + number + 1), reason);
        let mut words = line.split_whitespace();
        for (property, value) in vertex.properties.iter().zip(&mut row) {
            let mut next = || {
                let word = words
                    .next()
                    .ok_or_else(|| fault(format!("fewer values than the {} properties", vertex.properties.len())))?;
                word.parse::<f64>().map_err(|_| fault(no_number(word)))
            };
            match property {
                Property::One { .. } => *value = next()?,
                // Ends at the line's end at the latest.
                Property::List { .. } => {
                    let count = next()?;
                    for _ in 0..count.max(0.0) as u64 {
                        next()?;
                    }
                }
            }
        }
        push(gathered, places, &row);
    }
    if is_last && lines.next().is_some_and(|(_, line)| begins_with_number(line)) {
        return Err(more_than_announced(file, vertex.count));
    }
    Ok(())
}

/// A walk over packed rows.
struct Binary<'a> {
    file: &'a str,
    body: &'a [u8],
    at: usize,
    big_endian: bool,
}

impl Binary<'_> {
    fn need(&self, bytes: u64, place: impl Fn() -> String) -> Result<(), CloudError> {
        let there = (self.body.len() - self.at) as u64;
        if bytes <= there {
            return Ok(());
        }
        Err(CloudError::Truncated { file: self.file.into(), place: place(), needed: bytes, there })
    }

    /// Passes over an element that stands before the vertices.
    fn skip(&mut self, element: &Element) -> Result<(), CloudError> {
        if let Some(size) = element.fixed_size() {
            let bytes = size.saturating_mul(element.count);
            self.need(bytes, || format!("the element '{}'", element.name))?;
            self.at += bytes as usize;
            return Ok(());
        }
        let mut row = vec![0.0; element.properties.len()];
        (0..element.count).try_for_each(|i| self.row(element, i, &mut row))
    }

    fn row(&mut self, element: &Element, index: u64, row: &mut [f64]) -> Result<(), CloudError> {
        let place = || format!("{} {index} of {}", element.name, element.count);
        for (property, value) in element.properties.iter().zip(row) {
            match property {
                Property::One { number, .. } => {
                    self.need(number.size() as u64, place)?;
                    *value = number.take(self.body, self.at, self.big_endian);
                    self.at += number.size();
                }
                Property::List { count, item } => {
                    self.need(count.size() as u64, place)?;
                    let items = count.take(self.body, self.at, self.big_endian).max(0.0) as u64;
                    self.at += count.size();
                    let bytes = items.saturating_mul(item.size() as u64);
                    self.need(bytes, place)?;
                    self.at += bytes as usize;
                }
            }
        }
        Ok(())
    }
}
