//! The `poses` table of a shard -> where the rover is believed to stand at each kept scan.
//!
//! In: a file. Out: place and heading in the frame `map`, metres and radians, by scene and scan; height, roll and pitch are left at 0, since
//! cells lie in a level map. Steps between kept scans, whose scan is null, are passed by.

use std::collections::HashMap;

use arrow_array::Array;
use arrow_array::types::{Float64Type, Int32Type, Int64Type};

use super::CorpusError;
use super::reader::{TableFile, column};
use crate::geometry::{DVec3, Pose};

const COLUMNS: [&str; 5] = ["scene_id", "scan_id", "x_m", "y_m", "yaw_rad"];

/// Scene and scan.
pub(crate) type Scan = (i64, i32);

pub(crate) fn kept_poses(file: &TableFile) -> Result<HashMap<Scan, Pose>, CorpusError> {
    let mut poses = HashMap::new();
    for group in 0..file.row_groups().len() {
        let batch = file.read_row_group(group, Some(&COLUMNS))?;
        let mut add = || {
            let [scene_id, scan_id, x_m, y_m, yaw_rad] = COLUMNS;
            let scans = column::<Int32Type>(&batch, scan_id)?;
            let real = |name: &str| Ok::<_, String>(column::<Float64Type>(&batch, name)?.values());
            let (scenes, xs_m, ys_m, yaws_rad) =
                (column::<Int64Type>(&batch, scene_id)?.values(), real(x_m)?, real(y_m)?, real(yaw_rad)?);
            for row in (0..batch.num_rows()).filter(|&row| scans.is_valid(row)) {
                let position_m = DVec3::new(xs_m[row], ys_m[row], 0.0);
                let pose = Pose { position_m, yaw_rad: yaws_rad[row], ..Pose::default() };
                poses.insert((scenes[row], scans.value(row)), pose);
            }
            Ok(())
        };
        add().map_err(|reason: String| file.odd(reason))?;
    }
    Ok(poses)
}
