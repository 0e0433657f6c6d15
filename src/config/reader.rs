//! Files that a config names -> texts, beam patterns and height maps, each read once and within limits.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::{Fault, told};
use super::tree::{self, Node, Source, Span};
use crate::corpus::limits::FileKind;
use crate::corpus::store::may_pass;
use crate::corpus::{CorpusError, address};
use crate::geometry::DVec2;
use crate::scene::Raster;

/// Beams of the largest pattern; all of them stand in the resolved plan.
const MAX_BEAMS: usize = 250_000;
/// Nodes of the largest height map: 4096 x 4096.
const MAX_HEIGHTS: usize = 1 << 24;

/// The name under which a corpus holds its resolved config.
const PLAN: &str = "plan.yaml";

/// The sources of one config, and what was read for it.
#[derive(Default)]
pub(crate) struct Reader {
    pub sources: Vec<Source>,
    /// The folder that the files named must lie in: a corpus comes with all that its plan names.
    within: Option<PathBuf>,
    /// The config's own folder, links followed: what lies below it may be shown in messages.
    home: Option<PathBuf>,
    /// A file could not be read because its store could not be reached, or the system failed to.
    pub unreachable: Cell<bool>,
    /// Or because it is not known to be the store.
    pub untrusted: Cell<bool>,
    height_maps: BTreeMap<(PathBuf, Option<u64>), Result<HeightMap, String>>,
    patterns: BTreeMap<PathBuf, Result<Vec<[f64; 3]>, String>>,
}

/// A height map as it lies in its file; stretched over a yard later.
#[derive(Clone)]
pub(crate) struct HeightMap {
    pub raster: Arc<Raster>,
    pub blake3: String,
}

impl Reader {
    /// Takes a source in and reads its tree.
    pub(crate) fn parse(&mut self, source: Source) -> Result<Node, Fault> {
        let number = self.sources.len();
        self.sources.push(source);
        tree::parse(number, &self.sources[number].text, 0)
    }

    /// For the config at `path`: the plan of a corpus, which may be anybody's, names files beside itself only.
    pub(crate) fn of(path: &Path) -> Reader {
        let is_plan = path.file_name().is_some_and(|name| name == PLAN);
        Reader { within: is_plan.then(|| folder_of(path).to_owned()), ..Reader::beside(path) }
    }

    /// For the config at `path`.
    pub(crate) fn beside(path: &Path) -> Reader {
        Reader { home: real(folder_of(path)), ..Reader::default() }
    }

    /// Whether messages may show what stands in a file: a YAML or CSV file below the config's folder is the user's own; anything
    /// else that a config or a command line names may be a key, or the environment.
    pub(crate) fn may_show(&self, path: &Path) -> bool {
        let known =
            |path: &Path| path.extension().is_some_and(|end| ["yaml", "yml", "json", "csv"].iter().any(|e| end == *e));
        let plain = |below: &Path| below.iter().all(|part| !part.as_encoded_bytes().starts_with(b"."));
        let (Some(home), Some(path)) = (&self.home, real(path)) else { return false };
        path.strip_prefix(home).is_ok_and(plain) && known(&path)
    }

    /// Where relative paths written at a place start.
    pub(crate) fn folder(&self, span: Span) -> PathBuf {
        self.sources[span.source].folder.clone()
    }

    /// The path of a file that is named at a place.
    pub(crate) fn path_of(&self, span: Span, named: &str) -> Result<PathBuf, String> {
        let path = self.folder(span).join(named);
        if let Some(within) = &self.within {
            // Links and `..` followed; what is not there is found out when it is read.
            let leaves = match (within.canonicalize(), path.canonicalize()) {
                (Ok(within), Ok(path)) => !path.starts_with(within),
                _ => Path::new(named).is_absolute() || named.split('/').any(|part| part == ".."),
            };
            if leaves {
                return Err(format!(
                    "it lies outside the corpus: the {PLAN} of a corpus names files beside itself only; for a config of your own, \
                     choose another name"
                ));
            }
        }
        Ok(path)
    }

    fn bytes_of(&self, path: &Path) -> Result<Vec<u8>, String> {
        if address::is_url(path) {
            return address::read_url(path, FileKind::Config.most_bytes()).map_err(|error| {
                self.unreachable.set(self.unreachable.get() || matches!(error, CorpusError::Unreachable { .. }));
                self.untrusted.set(self.untrusted.get() || matches!(error, CorpusError::Untrusted { .. }));
                error.to_string()
            });
        }
        FileKind::Config.read_path(path).map_err(|error| {
            self.unreachable.set(self.unreachable.get() || may_pass(&error));
            match error.kind() {
                std::io::ErrorKind::NotFound => "there is no such file".into(),
                std::io::ErrorKind::PermissionDenied => "no permission".into(),
                std::io::ErrorKind::IsADirectory => "it is not a file but a folder".into(),
                _ => error.to_string(),
            }
        })
    }

    /// The text of a YAML file.
    pub(crate) fn text_of(&self, path: &Path) -> Result<String, String> {
        String::from_utf8(self.bytes_of(path)?).map_err(|_| "it is not UTF-8 text".into())
    }

    /// The beams of a pattern file: time_s, azimuth_deg, elevation_deg under a header of these names.
    pub(crate) fn pattern(&mut self, path: &Path) -> Result<Vec<[f64; 3]>, String> {
        if !self.patterns.contains_key(path) {
            let is_shown = self.may_show(path);
            let read = self.bytes_of(path).and_then(|bytes| pattern_of(&bytes)).map_err(|why| told(&why, is_shown));
            self.patterns.insert(path.to_owned(), read);
        }
        self.patterns[path].clone()
    }

    /// A height map (NPY or PNG), a metre from node to node: the scene stretches it over its yard.
    pub(crate) fn height_map(&mut self, path: &Path, white_m: Option<f64>) -> Result<HeightMap, String> {
        let key = (path.to_owned(), white_m.map(f64::to_bits));
        if !self.height_maps.contains_key(&key) {
            let read = self.bytes_of(path).and_then(|bytes| height_map_of(path, &bytes, white_m));
            self.height_maps.insert(key.clone(), read);
        }
        self.height_maps[&key].clone()
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A path with links followed; a URL has none.
fn real(path: &Path) -> Option<PathBuf> {
    let dots = |path: &Path| path.components().any(|part| part == std::path::Component::ParentDir);
    if address::is_url(path) { (!dots(path)).then(|| path.to_owned()) } else { path.canonicalize().ok() }
}

fn pattern_of(bytes: &[u8]) -> Result<Vec<[f64; 3]>, String> {
    let mut table = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(bytes);
    let header = table.headers().map_err(|error| error.to_string())?.clone();
    let mut columns = [0; 3];
    for (column, name) in columns.iter_mut().zip(["time_s", "azimuth_deg", "elevation_deg"]) {
        *column = header
            .iter()
            .position(|h| h == name)
            .ok_or_else(|| format!("its header lacks '{name}': the first line is time_s,azimuth_deg,elevation_deg"))?;
    }
    let mut beams: Vec<[f64; 3]> = Vec::new();
    for record in table.records() {
        let record = record.map_err(|error| error.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut beam = [0.0; 3];
        for (value, &column) in beam.iter_mut().zip(&columns) {
            let text = record.get(column).unwrap_or_default();
            let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
            *value =
                number.ok_or_else(|| format!("line {line}: '{}' is not a finite number", tree::shortened(text)))?;
        }
        let [time_s, azimuth_deg, elevation_deg] = beam;
        if azimuth_deg.abs() > 360.0 || elevation_deg.abs() > 90.0 {
            return Err(format!("line {line}: azimuth must lie in [-360, 360] and elevation in [-90, 90] degrees"));
        }
        if time_s < 0.0 || beams.last().is_some_and(|last| last[0] > time_s) {
            return Err(format!("line {line}: times must begin at 0 or later and never fall"));
        }
        if beams.len() == MAX_BEAMS {
            return Err(format!("it has more than {MAX_BEAMS} beams"));
        }
        beams.push(beam);
    }
    if beams.is_empty() { Err("it holds no beam".into()) } else { Ok(beams) }
}

fn height_map_of(path: &Path, bytes: &[u8], white_m: Option<f64>) -> Result<HeightMap, String> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let (rows, cols, heights_m) = match (extension.as_str(), white_m) {
        ("npy", None) => npy_heights(bytes)?,
        ("npy", Some(_)) => return Err("an NPY file is in metres already: take height_m out".into()),
        ("png", Some(white_m)) => png_heights(bytes, white_m)?,
        ("png", None) => return Err("a PNG needs height_m, the height of white above black".into()),
        _ => return Err("a height map is a .npy or a .png file".into()),
    };
    if rows < 2 || cols < 2 {
        return Err(format!("it has {rows} rows and {cols} columns; at least 2 of each are needed"));
    }
    if let Some(at) = heights_m.iter().position(|h| !h.is_finite() || h.abs() > 1e4) {
        return Err(format!("row {}, column {}: {} is no height in metres", at / cols, at % cols, heights_m[at]));
    }
    let raster = Raster { spacing_m: 1.0, origin_m: DVec2::ZERO, rows, cols, heights_m: heights_m.into() };
    Ok(HeightMap { raster: Arc::new(raster), blake3: blake3::hash(bytes).to_hex().to_string() })
}

type Heights = (usize, usize, Vec<f64>);

/// The header of an NPY file of formats 1 to 3, and the numbers behind it.
fn npy_parts(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (start, length) = match bytes {
        [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, low, high, ..] => {
            (10, usize::from(u16::from_le_bytes([*low, *high])))
        }
        [0x93, b'N', b'U', b'M', b'P', b'Y', 2 | 3, _, a, b, c, d, ..] => {
            (12, u32::from_le_bytes([*a, *b, *c, *d]) as usize)
        }
        _ => return None,
    };
    let end = length.checked_add(start)?;
    Some((str::from_utf8(bytes.get(start..end)?).ok()?, &bytes[end..]))
}

/// A 2-D array of float32 or float64, by rows or by columns. The header is the literal of a Python dictionary with
/// three keys (NEP 1); what NumPy itself writes is read, in any order of keys.
fn npy_heights(bytes: &[u8]) -> Result<Heights, String> {
    let (header, numbers) = npy_parts(bytes).ok_or("it is no NPY file, or its header ends early")?;
    let value = |key: &str| header.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
    let lacks = |key: &str| format!("its header lacks '{key}'");
    let descr = value("descr").ok_or_else(|| lacks("descr"))?;
    let descr = descr.split(',').next().unwrap_or_default();
    let float: fn(&[u8]) -> f64 = match descr {
        "'<f4'" => |bytes| f64::from(f32::from_le_bytes(bytes.try_into().expect("four bytes"))),
        "'>f4'" => |bytes| f64::from(f32::from_be_bytes(bytes.try_into().expect("four bytes"))),
        "'<f8'" => |bytes| f64::from_le_bytes(bytes.try_into().expect("eight bytes")),
        "'>f8'" => |bytes| f64::from_be_bytes(bytes.try_into().expect("eight bytes")),
        _ => return Err(format!("its numbers are {descr:.24}; a height map holds float32 or float64")),
    };
    let bytes_each = if descr.contains("f4") { 4 } else { 8 };
    let by_row = !value("fortran_order").ok_or_else(|| lacks("fortran_order"))?.starts_with("True");
    let shape =
        value("shape").and_then(|rest| rest.strip_prefix('(')?.split_once(')')).ok_or_else(|| lacks("shape"))?.0;
    let sides: Vec<&str> = shape.split(',').map(str::trim).filter(|side| !side.is_empty()).collect();
    let &[rows, cols] = &sides[..] else {
        return Err(format!("it has {} dimensions; a height map has 2", sides.len()));
    };
    let (Ok(rows), Ok(cols)) = (rows.parse::<usize>(), cols.parse::<usize>()) else {
        return Err(format!("its shape ({rows}, {cols}) is absurd; at most {MAX_HEIGHTS} heights"));
    };
    let count = rows.checked_mul(cols).filter(|&count| count <= MAX_HEIGHTS);
    let count = count.ok_or_else(|| format!("it has {rows} x {cols} heights; at most {MAX_HEIGHTS}"))?;
    let numbers = numbers.get(..count * bytes_each).ok_or("it ends early")?;
    let height = |at: usize| float(&numbers[at * bytes_each..][..bytes_each]);
    let heights_m = (0..count).map(|at| if by_row { height(at) } else { height(at % cols * rows + at / cols) });
    Ok((rows, cols, heights_m.collect()))
}

/// 16-bit grey; row 0 of the picture is the north edge, row 0 of a raster the south.
fn png_heights(bytes: &[u8], white_m: f64) -> Result<Heights, String> {
    let decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    let mut reader = decoder.read_info().map_err(|error| format!("it is no PNG: {error}"))?;
    let info = reader.info();
    let (rows, cols) = (info.height as usize, info.width as usize);
    if info.color_type != png::ColorType::Grayscale || info.bit_depth != png::BitDepth::Sixteen {
        return Err("it is not a 16-bit grey PNG".into());
    }
    if rows.checked_mul(cols).is_none_or(|count| count > MAX_HEIGHTS) {
        return Err(format!("it has {rows} x {cols} heights; at most {MAX_HEIGHTS}"));
    }
    let mut samples = vec![0; rows * cols * 2];
    reader.next_frame(&mut samples).map_err(|error| format!("its picture cannot be read: {error}"))?;
    let height = |at: usize| f64::from(u16::from_be_bytes([samples[2 * at], samples[2 * at + 1]])) / 65_535.0 * white_m;
    let heights_m = (0..rows).rev().flat_map(|row| (0..cols).map(move |col| row * cols + col)).map(height).collect();
    Ok((rows, cols, heights_m))
}

#[cfg(test)]
mod tests;
