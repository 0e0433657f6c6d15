//! The columns of a corpus -> those that a network takes.
//!
//! In: a [`FeatureSet`], a preset or a list of names, and the columns that there are. Out: the names of the inputs, in the corpus's order
//! or in the list's, and the unit of each.

use super::{FeatureSet, Source, TrainError};
use crate::cells::{
    LOCAL_HEIGHT, MEAN_HEIGHT, PLANE_HEIGHT, PLANE_SLOPE, is_beams, is_curvature, is_gap, is_neighbour, is_surroundings,
};

/// The columns of a preset, in the corpus's order.
pub(super) fn choose(source: &Source, set: &FeatureSet) -> Result<Vec<String>, TrainError> {
    if let FeatureSet::Columns(columns) = set {
        for (i, column) in columns.iter().enumerate() {
            unit_of(source, column)?;
            if columns[..i].contains(column) {
                return Err(TrainError::FeatureTwice { feature: column.clone() });
            }
        }
        return Ok(columns.clone());
    }
    let names = source.features.iter().map(|feature| feature.name.as_str());
    let taken = taken(set, names.clone());
    Ok(names.filter(|name| taken(name)).map(String::from).collect())
}

/// Tells which of a corpus's columns are a set's inputs.
pub(crate) fn taken<'c>(set: &FeatureSet, columns: impl Iterator<Item = &'c str> + Clone) -> impl Fn(&str) -> bool {
    let plane = columns.clone().any(|name| name == PLANE_HEIGHT);
    let bends = columns.clone().any(is_curvature);
    let squares = columns.clone().any(is_surroundings);
    let is_full = move |name: &str| is_full(plane, bends, squares, name);
    move |name| match set {
        FeatureSet::Listed => is_listed(name),
        FeatureSet::Full => is_full(name),
        FeatureSet::SeenUnseen => is_full(name) || is_gap(name),
        FeatureSet::All => true,
        FeatureSet::Columns(columns) => columns.iter().any(|column| column == name),
    }
}

/// The paper's features.
fn is_listed(name: &str) -> bool {
    !name.starts_with("sigma_") && !name.starts_with("intensity_") && !is_gap(name) && !is_of_the_ground(name)
}

/// What is told of a cell by the ground around it.
fn is_of_the_ground(name: &str) -> bool {
    [LOCAL_HEIGHT, PLANE_HEIGHT, PLANE_SLOPE].contains(&name)
        || is_curvature(name)
        || is_surroundings(name)
        || is_beams(name)
}

/// With what else is worth having by any sensor. Standard deviations of the pose bring a network nothing (`scripts/pose_columns.py`).
/// Where a plane tells the slope of the ground around, the pose says nothing more of a cell;
/// a network that takes it calls whole scans on slopes that its training never had untraversable. Where it is also known how the ground
/// bends or what the squares around hold, heights above the rover and steps to the neighbours say more of the slope than of what stands on
/// it; so does the height above a percentile of the ground, where squares of heights above the plane are known. Measured by
/// `scripts/ablation.py`.
fn is_full(plane: bool, bends: bool, squares: bool, name: &str) -> bool {
    if ["pitch_rad", "roll_rad"].contains(&name) {
        !plane
    } else if name == MEAN_HEIGHT || is_neighbour(name) {
        !(plane && (bends || squares))
    } else if name == LOCAL_HEIGHT {
        !squares
    } else {
        is_listed(name) || is_of_the_ground(name)
    }
}

pub(super) fn unit_of<'s>(source: &'s Source, name: &str) -> Result<&'s str, TrainError> {
    source.features.iter().find(|feature| feature.name == name).map(|feature| feature.unit.as_str()).ok_or_else(|| {
        TrainError::NoFeature {
            place: source.place(),
            feature: name.into(),
            known: source.features.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(" "),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::params::{CurvatureParams, LocalHeightParams, SurroundingsParams};
    use crate::cells::{CellParams, feature_columns};

    #[test]
    fn exact_listed_is_the_papers_list_and_full_takes_the_ground_around_and_the_plane_for_the_pose() {
        let chosen = |set: FeatureSet, params: &CellParams| {
            let names: Vec<String> = feature_columns(params, true).into_iter().map(|column| column.name).collect();
            let taken = taken(&set, names.iter().map(String::as_str));
            names.iter().filter(|name| taken(name)).cloned().collect::<Vec<_>>()
        };
        let bare = CellParams::default();
        let local = CellParams { local_height: Some(LocalHeightParams::default()), ..CellParams::default() };
        let listed = chosen(FeatureSet::Listed, &local);
        assert_eq!((listed.len(), &listed), (14, &chosen(FeatureSet::Listed, &bare)));
        assert_eq!(listed[13], "neighbour_ne_m");
        assert_eq!(chosen(FeatureSet::Full, &bare), listed, "standard deviations of the pose are left out");
        let full = chosen(FeatureSet::Full, &local);
        assert_eq!((&full[..14], &full[14..]), (&listed[..], &["local_height_m".to_owned()][..]));
        let around = Some(LocalHeightParams { plane: true, ..LocalHeightParams::default() });
        let plane = CellParams { local_height: around, ..CellParams::default() };
        let of_the_plane = ["local_height_m", "plane_height_m", "plane_slope"];
        let with_plane = chosen(FeatureSet::Full, &plane);
        assert_eq!(with_plane[..4], listed[..4], "pitch and roll are left out");
        assert_eq!(with_plane[4..12], listed[6..]);
        assert_eq!(with_plane[12..], of_the_plane);
        let curvature = Some(CurvatureParams { radii_m: vec![0.2] });
        let bends = ["curvature_least_20cm_m", "curvature_most_20cm_m"];
        let with_both = chosen(FeatureSet::Full, &CellParams { curvature: curvature.clone(), ..plane.clone() });
        assert_eq!(with_both[..3], listed[1..4], "heights above the rover and neighbours are left out");
        assert_eq!(
            (&with_both[3..6], &with_both[6..]),
            (&of_the_plane.map(String::from)[..], &bends.map(String::from)[..])
        );
        let around = Some(SurroundingsParams { radii_m: vec![0.4] });
        let with_squares =
            chosen(FeatureSet::Full, &CellParams { curvature: curvature.clone(), surroundings: around, ..plane });
        let squares = ["height_40cm_m", "roughness_40cm_m", "spread_40cm_m", "cover_40cm"];
        assert_eq!((&with_squares[..3], &with_squares[3..7]), (&with_both[..3], &with_both[4..]), "no local height");
        assert_eq!(with_squares[7..], squares.map(|name| format!("surroundings_{name}")));
        let without_plane = CellParams { curvature, ..bare };
        assert_eq!(chosen(FeatureSet::Full, &without_plane)[..14], listed);
        assert_eq!(chosen(FeatureSet::Full, &without_plane)[14..], bends);
        assert_eq!(chosen(FeatureSet::Listed, &without_plane), listed);
        // Cells without points have columns of their own, which no other preset takes.
        let params = CellParams { unseen: Some(Default::default()), ..CellParams::default() };
        let count = |set| chosen(set, &params).len();
        assert_eq!([FeatureSet::Full, FeatureSet::SeenUnseen, FeatureSet::All].map(count), [14, 30, 38]);
        assert_eq!(serde_json::to_string(&FeatureSet::SeenUnseen).unwrap(), "\"seen+unseen\"");
    }
}
