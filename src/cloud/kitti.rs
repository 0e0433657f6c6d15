//! KITTI velodyne `.bin`: four little-endian f32 a point (x forward, y left, z up, remission). SemanticKITTI `.label`: one
//! little-endian u32 a point, its lower half the class, its upper half an instance.

use super::{Cloud, CloudError, Gathered};
use crate::geometry::DVec3;

pub(super) fn read(file: &str, bytes: &[u8], labels: Option<&[u8]>) -> Result<Cloud, CloudError> {
    let (points, rest) = bytes.as_chunks::<16>();
    if !rest.is_empty() {
        return Err(CloudError::Truncated {
            file: file.into(),
            place: format!("point {} (16 bytes a point)", points.len()),
            needed: 16,
            there: rest.len() as u64,
        });
    }
    let ids = labels.map(|bytes| bytes.as_chunks::<4>().0);
    if let (Some(ids), Some(bytes)) = (ids, labels)
        && (ids.len() != points.len() || bytes.len() % 4 != 0)
    {
        return Err(CloudError::Malformed {
            file: file.into(),
            place: "its .label file".into(),
            reason: format!(
                "{} bytes for {} points: it belongs to another scan; it must have 4 bytes a point",
                bytes.len(),
                points.len()
            ),
        });
    }
    let mut gathered = Gathered::new(true, ids.is_some());
    for (i, point) in points.iter().enumerate() {
        let value = |k: usize| f64::from(f32::from_le_bytes(point.as_chunks::<4>().0[k]));
        let label = ids.map_or(f64::NAN, |ids| f64::from(u32::from_le_bytes(ids[i]) & 0xffff));
        gathered.push(DVec3::new(value(0), value(1), value(2)), value(3), label);
    }
    gathered.finish(file)
}
