//! Files of real scans -> points, labels, poses.
//!
//! In: the bytes of PLY, PCD, LAS, CSV / XYZ or KITTI files (`read`), of a mapping of their labels (`labels`) and of a TUM file
//! of poses ([`trajectory`]). Out: a [`Cloud`], in the file's own frame, in metres; a verdict a point; a pose a scan. What a model says
//! of them is the business of `judge`. Not read: LAZ, several echoes a beam, the time of a point.

pub(crate) mod error;
mod fields;
mod kitti;
pub(crate) mod labels;
mod las;
mod lzf;
mod pcd;
mod ply;
mod read;
mod text;
pub mod trajectory;

#[cfg(test)]
mod tests;

pub use error::CloudError;
pub use labels::LabelMap;
pub(crate) use read::Format;
pub use read::{Options, read};

use crate::geometry::DVec3;
use fields::FieldOffsets;

/// The points of one scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    pub points_m: Vec<DVec3>,
    /// One a point, where the file has them.
    pub intensity: Option<Vec<f32>>,
    /// Label ids, one a point, where the file has them.
    pub labels: Option<Vec<i64>>,
    /// Points of the file that are not here, because a coordinate is NaN or infinite.
    pub not_finite: u64,
}

impl Cloud {
    /// Leaves out the points at exactly this place, and says how many they were: many drivers write beams without a return so.
    pub(crate) fn drop_at(&mut self, place_m: DVec3) -> u64 {
        let there: Vec<bool> = self.points_m.iter().map(|&p| p == place_m).collect();
        self.drop_marked(&there)
    }

    /// Leaves out the marked points, and says how many they were.
    pub(crate) fn drop_marked(&mut self, marks: &[bool]) -> u64 {
        let before = self.points_m.len();
        drop_from(&mut self.points_m, marks);
        self.intensity.iter_mut().for_each(|values| drop_from(values, marks));
        self.labels.iter_mut().for_each(|values| drop_from(values, marks));
        (before - self.points_m.len()) as u64
    }
}

fn drop_from<T>(values: &mut Vec<T>, marks: &[bool]) {
    let mut marks = marks.iter();
    values.retain(|_| marks.next() != Some(&true));
}

/// Labels beyond are no longer told apart by a f64.
const MOST_LABEL: f64 = 9e15;

/// Whether what follows the announced points has room for another one, and is more than zeros up to a full block.
fn holds_more(rest: &[u8], point_bytes: u64) -> bool {
    point_bytes > 0 && rest.len() as u64 >= point_bytes && rest.iter().any(|byte| *byte != 0)
}

/// Whether a line of a text body holds nothing; zero bytes are padding.
fn is_blank(line: &str) -> bool {
    line.trim_matches(|c: char| c.is_whitespace() || c == '\0').is_empty()
}

/// Whether a line behind the announced points may be one, and not a remark.
fn begins_with_number(line: &str) -> bool {
    line.split_whitespace().next().is_some_and(fields::is_number)
}

/// A file whose header announces fewer points than it holds.
fn more_than_announced(file: &str, count: u64) -> CloudError {
    let reason = format!("it announces {count} points, and more follow; set the count right, or write the file anew");
    CloudError::Malformed { file: file.into(), place: "the header".into(), reason }
}

/// Points in the making: drops and counts what is no place.
#[derive(Debug, Default)]
struct Gathered {
    cloud: Cloud,
    /// The first label that is no whole number, and whose it is.
    no_label: Option<(u64, f64)>,
    is_label_named: bool,
}

impl Gathered {
    /// For a file that has these columns. Nothing is reserved: sizes in headers are not to be trusted.
    fn new(intensity: bool, labels: bool) -> Gathered {
        let cloud = Cloud { intensity: intensity.then(Vec::new), labels: labels.then(Vec::new), ..Cloud::default() };
        Gathered { cloud, ..Gathered::default() }
    }

    /// For a file with these columns among others.
    fn of(offsets: &FieldOffsets) -> Gathered {
        let gathered = Gathered::new(offsets.intensity.is_some(), offsets.label.is_some());
        Gathered { is_label_named: offsets.is_label_named, ..gathered }
    }

    /// `label`: a whole number; NaN, which is none, becomes -1.
    fn push(&mut self, point_m: DVec3, intensity: f64, label: f64) {
        if !point_m.is_finite() {
            self.cloud.not_finite += 1;
            return;
        }
        self.cloud.points_m.push(point_m);
        if let Some(values) = &mut self.cloud.intensity {
            values.push(intensity as f32);
        }
        if let Some(values) = &mut self.cloud.labels {
            let is_label = label.fract() == 0.0 && label.abs() <= MOST_LABEL;
            if !is_label && !label.is_nan() && self.no_label.is_none() {
                let point = self.cloud.points_m.len() as u64 - 1 + self.cloud.not_finite;
                self.no_label = Some((point, label));
            }
            values.push(if is_label { label as i64 } else { -1 });
        }
    }

    /// The cloud, if there is a point in it. A column that holds other than whole numbers is none of labels; the user may have named it
    /// as one all the same.
    fn finish(mut self, file: &str) -> Result<Cloud, CloudError> {
        match self.no_label {
            Some((point, label)) if self.is_label_named => {
                let reason =
                    format!("its label is {label}, and labels are whole numbers; name their column with --label-field");
                return Err(CloudError::Malformed { file: file.into(), place: format!("point {point}"), reason });
            }
            Some(_) => self.cloud.labels = None,
            None => {}
        }
        if self.cloud.points_m.is_empty() {
            return Err(CloudError::NoPoints { file: file.into(), not_finite: self.cloud.not_finite });
        }
        Ok(self.cloud)
    }
}
