//! A file's name and bytes -> its cloud.
//!
//! The whole file is in memory; nothing beyond a small multiple of its size is reserved, whatever its header announces.

use std::path::Path;

use super::{Cloud, CloudError, kitti, las, pcd, ply, text};

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Ply,
    Pcd,
    Las,
    /// Lines of numbers, separated by commas, semicolons or blanks; with or without a header.
    Text,
    /// Four f32 a point: x, y, z, remission; labels in a file of their own.
    Kitti,
}

/// How to read what a file leaves open.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The column that holds the label ids; default: `label`, `class`, `classification` or `semantic`.
    pub label_field: Option<String>,
}

impl Format {
    /// By the end of the name.
    pub(crate) fn of(name: &str) -> Result<Format, CloudError> {
        let end = Path::new(name).extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        match end.as_str() {
            "ply" => Ok(Format::Ply),
            "pcd" => Ok(Format::Pcd),
            "las" => Ok(Format::Las),
            "laz" => Err(CloudError::NotSupported {
                file: name.into(),
                feature: "LAZ (compressed LAS)".into(),
                cure: "convert it to .las (for example with `laszip -i x.laz -o x.las`)",
            }),
            "csv" | "xyz" | "txt" | "asc" | "pts" => Ok(Format::Text),
            "bin" => Ok(Format::Kitti),
            _ => Err(CloudError::UnknownFormat { file: name.into() }),
        }
    }
}

/// The cloud of a file. `labels`: the bytes of a KITTI `.label` file.
pub fn read(name: &str, bytes: &[u8], labels: Option<&[u8]>, options: &Options) -> Result<Cloud, CloudError> {
    let label_field = options.label_field.as_deref();
    match Format::of(name)? {
        Format::Ply => ply::read(name, bytes, label_field),
        Format::Pcd => pcd::read(name, bytes, label_field),
        Format::Las => las::read(name, bytes),
        Format::Text => text::read(name, bytes, label_field),
        Format::Kitti => kitti::read(name, bytes, labels),
    }
}
