//! LAS 1.0 to 1.4, point formats 0 to 10: coordinates, intensity and the ASPRS class (as label id).
//!
//! Header and point records are the `las` crate's; variable-length records are skipped unread, because their announced lengths
//! are not to be trusted. Not here: LAZ, waveforms, coordinate systems (coordinates are taken as metres as they are).

use las::point::Format;
use las::raw;

use super::{Cloud, CloudError, Gathered};
use crate::geometry::DVec3;

pub(super) fn read(file: &str, bytes: &[u8]) -> Result<Cloud, CloudError> {
    let malformed =
        |place: &str, reason: String| CloudError::Malformed { file: file.into(), place: place.into(), reason };
    let header = raw::Header::read_from(bytes).map_err(|e| malformed("the header", format!("not LAS: {e}")))?;
    if header.point_data_record_format & 0xc0 != 0 {
        return Err(CloudError::NotSupported {
            file: file.into(),
            feature: "compressed LAS".into(),
            cure: "convert it (for example with `laszip -i x.laz -o x.las`)",
        });
    }
    let mut format = Format::new(header.point_data_record_format)
        .map_err(|e| malformed("the header", format!("point format {}: {e}", header.point_data_record_format)))?;
    let length = usize::from(header.point_data_record_length);
    let least = usize::from(format.len());
    if length < least {
        return Err(malformed("the header", format!("points of {length} bytes, their format needs {least}")));
    }
    format.extra_bytes = (length - least) as u16;
    let count =
        header.large_file.map_or(u64::from(header.number_of_point_records), |large| large.number_of_point_records);
    let start = usize::try_from(header.offset_to_point_data).unwrap_or(usize::MAX);
    let data = bytes.get(start..).unwrap_or(&[]);
    let there = (data.len() / length.max(1)) as u64;
    if there < count {
        return Err(CloudError::Truncated {
            file: file.into(),
            place: format!("the block of {count} points"),
            needed: count.saturating_mul(length as u64),
            there: data.len() as u64,
        });
    }
    let scale = |axis: usize, raw: i32| {
        let (scale, offset) = match axis {
            0 => (header.x_scale_factor, header.x_offset),
            1 => (header.y_scale_factor, header.y_offset),
            _ => (header.z_scale_factor, header.z_offset),
        };
        f64::from(raw) * scale + offset
    };
    let mut gathered = Gathered::new(true, true);
    for (i, record) in data.chunks_exact(length).take(count as usize).enumerate() {
        let point =
            raw::Point::read_from(record, &format).map_err(|e| malformed(&format!("point {i}"), e.to_string()))?;
        let class = match point.flags {
            raw::point::Flags::TwoByte(_, class) => class & 0x1f,
            raw::point::Flags::ThreeByte(_, _, class) => class,
        };
        let place = DVec3::new(scale(0, point.x), scale(1, point.y), scale(2, point.z));
        gathered.push(place, f64::from(point.intensity), f64::from(class));
    }
    gathered.finish(file)
}
