//! A TUM file (`t x y z qx qy qz qw` a line) -> the pose of each cloud.
//!
//! A cloud is matched by time where its file's name (without its ending) is a number that is a time of the trajectory to within a
//! tolerance: seconds, or whole nanoseconds. Where no name is, and there are as many lines as clouds, the lines are taken in
//! order. Whole numbers of one width, of which one at least is filled up with zeros (`000010.bin`), are numbers of frames and no times. Nothing
//! else is guessed.

use super::CloudError;
use crate::geometry::{DMat3, DVec3, Pose, Transform};

/// A time and a pose.
pub(crate) type Stamped = (f64, Pose);

/// The poses of a file; empty lines and those that start with `#` are skipped.
pub fn parse(file: &str, text: &str) -> Result<Vec<Stamped>, CloudError> {
    let mut poses = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let malformed =
            |reason: String| CloudError::Malformed { file: file.into(), place: format!("line {}", number + 1), reason };
        let values: Vec<f64> = line
            .split([' ', '\t', ','])
            .filter(|word| !word.is_empty())
            .map(|word| word.parse::<f64>().map_err(|_| malformed("a value is not a number".into())))
            .collect::<Result<_, _>>()?;
        let [time_s, x, y, z, qx, qy, qz, qw] = values[..] else {
            return Err(malformed(format!("{} values; a line is `t x y z qx qy qz qw`", values.len())));
        };
        let norm = (qx * qx + qy * qy + qz * qz + qw * qw).sqrt();
        if !values.iter().all(|v| v.is_finite()) || !(0.9..=1.1).contains(&norm) {
            return Err(malformed(format!(
                "the quaternion's length is {norm}, or a value is not finite; it must be 1"
            )));
        }
        let rotation = rotation([qx, qy, qz, qw].map(|q| q / norm));
        poses.push((time_s, Pose::from_transform(&Transform { rotation, translation_m: DVec3::new(x, y, z) })));
    }
    Ok(poses)
}

/// The matrix of a unit quaternion (x, y, z, w).
fn rotation([x, y, z, w]: [f64; 4]) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        DVec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        DVec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
}

/// One pose a cloud. `stems`: the clouds' names without their endings.
pub fn match_clouds(
    file: &str,
    poses: &[Stamped],
    stems: &[String],
    tolerance_s: f64,
) -> Result<Vec<Pose>, CloudError> {
    let are_frames = are_frame_numbers(stems);
    let pose_of = |stem: &String| if are_frames { None } else { at_time(poses, stem, tolerance_s) };
    let by_time: Vec<Option<Pose>> = stems.iter().map(pose_of).collect();
    if by_time.iter().all(Option::is_none) && poses.len() == stems.len() {
        return Ok(poses.iter().map(|(_, pose)| *pose).collect());
    }
    let found = |(pose, stem): (Option<Pose>, &String)| {
        pose.ok_or_else(|| CloudError::NoPose {
            file: file.into(),
            cloud: stem.clone(),
            reason: format!(
                "its name is {}; name clouds by their times{}, or give as many lines ({}) as clouds ({})",
                if are_frames {
                    "the number of a frame".to_string()
                } else {
                    format!("no time of the trajectory to within {tolerance_s} s")
                },
                if are_frames { "" } else { ", widen --time-tolerance" },
                poses.len(),
                stems.len()
            ),
        })
    };
    by_time.into_iter().zip(stems).map(found).collect()
}

/// Most digits of a frame's number; more are nanoseconds.
const MOST_FRAME_DIGITS: usize = 12;
/// Fewest digits of a time in nanoseconds: ten milliseconds. Numbers of frames have fewer.
const LEAST_NANOSECOND_DIGITS: usize = 8;

/// Whether names are numbers of frames, as KITTI has them: whole numbers of one width, of which one at least is filled up with zeros.
fn are_frame_numbers(stems: &[String]) -> bool {
    let width = stems.first().map_or(0, String::len);
    let is_whole = |stem: &String| stem.len() == width && stem.bytes().all(|byte| byte.is_ascii_digit());
    (2..=MOST_FRAME_DIGITS).contains(&width)
        && stems.iter().all(is_whole)
        && stems.iter().any(|stem| stem.starts_with('0'))
}

/// The pose nearest to the time that a name tells.
fn at_time(poses: &[Stamped], stem: &str, tolerance_s: f64) -> Option<Pose> {
    let time: f64 = stem.parse().ok()?;
    let is_long = stem.len() >= LEAST_NANOSECOND_DIGITS && stem.bytes().all(|byte| byte.is_ascii_digit());
    let nearest = |time_s: f64| {
        let off = |stamped: &&Stamped| (stamped.0 - time_s).abs();
        poses.iter().min_by(|a, b| off(a).total_cmp(&off(b))).filter(|stamped| off(stamped) <= tolerance_s)
    };
    nearest(time).or_else(|| nearest(time * 1e-9).filter(|_| is_long)).map(|(_, pose)| *pose)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stems(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| name.to_string()).collect()
    }

    #[test]
    fn equal_poses_that_slam_writes_read_back() {
        let pose = |k: f64| Pose {
            position_m: DVec3::new(k, -2.0 * k, 0.3),
            roll_rad: 0.1 * k,
            pitch_rad: -0.2,
            yaw_rad: 3.0 - 0.5 * k,
        };
        let there: Vec<(f64, Pose)> = (0..6).map(|k| (0.5 * f64::from(k), pose(f64::from(k)))).collect();
        let text = crate::slam::tum(there.iter().map(|(t, p)| (*t, p)));
        let back = parse("a.tum", &text).unwrap();
        for ((t, p), (s, q)) in there.iter().zip(&back) {
            assert_eq!((t, p.position_m), (s, q.position_m));
            let angles = [p.roll_rad - q.roll_rad, p.pitch_rad - q.pitch_rad, p.yaw_rad - q.yaw_rad];
            assert!(angles.iter().all(|a| a.abs() < 1e-14), "{p:?} {q:?}");
        }
    }

    #[test]
    fn exact_clouds_match_by_seconds_nanoseconds_or_order() {
        let poses = parse("a.tum", "# t\n100.0 1 0 0 0 0 0 1\n100.1 2 0 0 0 0 0 1\n\n100.2 3 0 0 0 0 0 1\n").unwrap();
        let x = |names: &[&str]| {
            let found = match_clouds("a.tum", &poses, &stems(names), 0.02);
            found.map(|poses| poses.iter().map(|p| p.position_m.x).collect::<Vec<_>>())
        };
        assert_eq!(x(&["100.21", "99.99"]).unwrap(), [3.0, 1.0]);
        assert_eq!(x(&["100100000000"]).unwrap(), [2.0]);
        assert_eq!(x(&["a", "b", "c"]).unwrap(), [1.0, 2.0, 3.0]);
        // Frame 100 of a KITTI drive is not the scan at 100 seconds; frames before it make the names of one width.
        assert_eq!(x(&["000100", "000101", "100102"]).unwrap(), [1.0, 2.0, 3.0]);
        assert!(x(&["000100"]).unwrap_err().to_string().contains("the number of a frame"));
        // Nor is a short whole number so many nanoseconds, which the start of any drive is near to.
        let start = parse("a.tum", "0.0 7 0 0 0 0 0 1\n").unwrap();
        assert!(match_clouds("a.tum", &start, &stems(&["1500", "1501"]), 0.02).is_err());
        assert!(match_clouds("a.tum", &start, &stems(&["10000000", "0"]), 0.02).is_ok());
        assert!(x(&["a", "b"]).is_err() && x(&["100.05"]).is_err() && x(&["100.0", "b", "c"]).is_err());
    }

    #[test]
    fn extreme_lines_that_are_no_pose_are_refused_with_their_number() {
        for bad in ["1 2 3", "0 0 0 0 0 0 0 0", "0 0 0 0 0 0 0 nan", "a b c d e f g h"] {
            let error = parse("a.tum", &format!("0 0 0 0 0 0 0 1\n{bad}")).unwrap_err().to_string();
            assert!(error.starts_with("a.tum: line 2: "), "{error}");
        }
    }
}
