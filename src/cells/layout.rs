//! Cell parameters -> where in a row's features each group of columns begins, in the order of [`feature_columns`](super::feature_columns).
//!
//! Own points, neighbours, local height and plane, curvature, squares around, beams, standard deviations of the pose, intensities. The
//! columns of gaps, which `unseen` adds, stand behind all of them.

use super::columns::neighbour_offsets;
use super::params::{BeamParams, LocalHeightParams};
use super::{CellParams, surroundings};

/// Indices into the features of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub local: usize,
    pub curvature: usize,
    pub squares: usize,
    pub beams: usize,
    pub sigmas: usize,
    /// Whether the last two features are of intensities.
    pub intensity: bool,
    /// Features of a row.
    pub width: usize,
}

impl Layout {
    /// The means of the neighbours' heights begin here, behind mean, variance, difference, count, pitch and roll.
    pub(super) const NEIGHBOURS: usize = 6;
    const SIGMAS: usize = 6;

    pub(super) fn of(params: &CellParams, intensity: bool) -> Layout {
        let local = Layout::NEIGHBOURS + neighbour_offsets(params.neighbours).len();
        let curvature = local + params.local_height.as_ref().map_or(0, LocalHeightParams::columns);
        let squares = curvature + params.curvature.as_ref().map_or(0, |of| 2 * of.radii_m.len());
        let of_squares = params.surroundings.as_ref().map_or(0, |of| surroundings::NAMES.len() * of.radii_m.len());
        let beams = squares + of_squares;
        let sigmas = beams + params.beams.as_ref().map_or(0, BeamParams::columns);
        let width = sigmas + Layout::SIGMAS + if intensity { 2 } else { 0 };
        Layout { local, curvature, squares, beams, sigmas, intensity, width }
    }

    /// The height above the plane of the ground around, where one is fitted; its slope stands behind it.
    pub(super) fn plane_height(&self) -> usize {
        self.local + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::params::{CurvatureParams, SurroundingsParams};
    use crate::cells::{
        LOCAL_HEIGHT, PLANE_HEIGHT, feature_columns, is_beams, is_curvature, is_neighbour, is_surroundings,
    };

    /// Every choice of groups: each that is there begins where its first column stands, and none of the others has room.
    #[test]
    fn law_groups_begin_where_their_first_columns_stand() {
        for choice in 0..3 * 2 * 2 * 2 * 2 * 3 {
            let mut rest = choice;
            let mut next = |count: u32| {
                let own = rest % count;
                rest /= count;
                own
            };
            let neighbours = [4, 8, 24][next(3) as usize];
            let intensity = next(2) == 1;
            let params = CellParams {
                neighbours,
                curvature: (next(2) == 1).then(|| CurvatureParams { radii_m: vec![0.2, 0.4, 0.8] }),
                surroundings: (next(2) == 1).then(|| SurroundingsParams { radii_m: vec![0.2, 0.4] }),
                beams: (next(2) == 1).then(|| BeamParams { radii_m: vec![0.1, 0.4] }),
                local_height: match next(3) {
                    0 => None,
                    of => Some(LocalHeightParams { plane: of == 2, ..Default::default() }),
                },
                ..CellParams::default()
            };
            let names: Vec<String> = feature_columns(&params, intensity).into_iter().map(|of| of.name).collect();
            let first = |is: &dyn Fn(&str) -> bool| names.iter().position(|name| is(name));
            let layout = Layout::of(&params, intensity);
            assert_eq!(first(&is_neighbour), Some(Layout::NEIGHBOURS));
            assert_eq!(first(&|name| name == LOCAL_HEIGHT), params.local_height.as_ref().map(|_| layout.local));
            let has_plane = params.local_height.as_ref().is_some_and(|local| local.plane);
            assert_eq!(first(&|name| name == PLANE_HEIGHT), has_plane.then(|| layout.plane_height()));
            assert_eq!(first(&is_curvature), params.curvature.as_ref().map(|_| layout.curvature));
            assert_eq!(first(&is_surroundings), params.surroundings.as_ref().map(|_| layout.squares));
            assert_eq!(first(&is_beams), params.beams.as_ref().map(|_| layout.beams));
            assert_eq!(first(&|name| name.starts_with("sigma_")), Some(layout.sigmas));
            assert_eq!((first(&|name| name == "intensity_mean").is_some(), names.len()), (intensity, layout.width));
        }
    }
}
