//! Rules of a family's cells: what their columns need of each other, the frame, and labels by a rover.

use super::Rules;
use crate::cells::CellFrame;

/// Cells from the centre to the rim of the ground around a cell: some 31,000 cells lie within.
const MAX_LOCAL_RADIUS_CELLS: f64 = 100.0;
/// A square around a cell reaches so many cells at most: the time grows with its area.
const MAX_SQUARE_CELLS: f64 = 10.0;

impl Rules<'_, '_, '_> {
    pub(super) fn cells(&mut self) {
        let cells = &self.family.cells;
        if cells.size_m > self.family.scene.extent_m {
            let rule =
                format!("a cell of {} m is larger than the yard of {} m", cells.size_m, self.family.scene.extent_m);
            self.fault("cells.size_m", rule, "about one wheel diameter is usual", &[("scene.extent_m", "the yard")]);
        }
        if let Some(max_m) = cells.max_range_m
            && cells.size_m > max_m
        {
            let rule = format!("a cell of {} m is larger than max_range_m ({max_m} m)", cells.size_m);
            let also = [("cells.max_range_m", "the range")];
            self.fault("cells.size_m", rule, "about one wheel diameter is usual", &also);
        }
        if let Some(local) = &cells.local_height
            && local.radius_m > MAX_LOCAL_RADIUS_CELLS * cells.size_m * (1.0 + 1e-9)
        {
            let rule = format!(
                "a radius of {} m is more than {MAX_LOCAL_RADIUS_CELLS} cells of {} m",
                local.radius_m, cells.size_m
            );
            let cure = "1 m is usual; the time grows with the radius in cells";
            self.fault("cells.local_height.radius_m", rule, cure, &[("cells.size_m", "the cell")]);
        }
        if let Some(curvature) = &cells.curvature {
            self.radii("cells.curvature.radii_m", &curvature.radii_m, MAX_LOCAL_RADIUS_CELLS, "[0.2, 0.4, 0.8]");
        }
        if let Some(surroundings) = &cells.surroundings {
            self.radii("cells.surroundings.radii_m", &surroundings.radii_m, MAX_SQUARE_CELLS, "[0.2, 0.4]");
            self.needs_plane("cells.surroundings", "heights of the squares are above");
        }
        if let Some(beams) = &cells.beams {
            self.radii("cells.beams.radii_m", &beams.radii_m, MAX_SQUARE_CELLS, "[0.1, 0.2, 0.4]");
            self.needs_plane("cells.beams", "heights of the beams are above");
        }
    }

    /// What is above the plane around a cell needs that plane.
    fn needs_plane(&mut self, key: &str, what: &str) {
        if !self.family.cells.local_height.as_ref().is_some_and(|local| local.plane) {
            let rule = format!("{what} the plane around, which is not asked for");
            self.fault(key, rule, "add cells.local_height: {plane: true}", &[("cells.local_height", "here")]);
        }
    }

    /// Distances in cells, in rising order.
    fn radii(&mut self, key: &str, radii_m: &[f64], most_cells: f64, usual: &str) {
        let size_m = self.family.cells.size_m;
        let cure = format!("cells of 0.1 m go with {usual}");
        let mut before_m = 0.0;
        for (k, &radius_m) in radii_m.iter().enumerate() {
            let key = format!("{key}[{k}]");
            if !(1.0 - 1e-9..=most_cells * (1.0 + 1e-9)).contains(&(radius_m / size_m)) {
                let rule = format!("a distance of {radius_m} m is not between 1 and {most_cells} cells of {size_m} m");
                self.fault(&key, rule, &cure, &[("cells.size_m", "the cell")]);
            } else if radius_m <= before_m {
                let rule = format!("{radius_m} m does not lie beyond {before_m} m: distances rise");
                self.fault(&key, rule, &cure, &[]);
            }
            before_m = radius_m;
        }
    }

    pub(super) fn frame(&mut self) {
        let cells = &self.family.cells;
        if cells.frame == CellFrame::FittedPlane && cells.window_scans > 1 {
            let rule = format!(
                "a window of {} sweeps has no one frame: with fitted_plane each sweep is levelled by its own points",
                cells.window_scans
            );
            let also = [("cells.window_scans", "the window")];
            self.fault("cells.frame", rule, "write window_scans: 1, or frame: estimated_pose", &also);
        }
        if cells.frame == CellFrame::FittedPlane && cells.labels.rover.as_ref().is_some_and(|rover| rover.pose) {
            let rule = "headings are those of the yard, which a frame fitted to one sweep does not know".to_string();
            let also = [("cells.labels.rover.pose", "the truth of poses")];
            self.fault("cells.frame", rule, "leave pose out, or write frame: estimated_pose", &also);
        }
    }

    pub(super) fn rover_labels(&mut self) {
        let labels = &self.family.cells.labels;
        let Some(rule) = &labels.rover else { return };
        let missing = rule.missing();
        if !missing.is_empty() {
            let rover = &self.family.drive.rover.name;
            let rule =
                format!("neither 'cells.labels.rover' nor the file of the rover '{rover}' says {}", missing.join(", "));
            let cure = "write `limits:` into the rover's file, or the keys under cells.labels.rover";
            self.fault("cells.labels.rover", rule, cure, &[("drive.rover", "the rover")]);
        }
        let (points, slope_deg) = (labels.min_obstacle_points, labels.max_ground_slope_deg);
        let by_points = [
            ("cells.labels.min_obstacle_points", points > 1, "take it out: the rover counts no points"),
            ("cells.labels.max_ground_slope_deg", slope_deg.is_some(), "take it out: max_tilt_deg bounds slopes"),
        ];
        for (key, _, cure) in by_points.into_iter().filter(|(_, is_named, _)| *is_named) {
            let also = [("cells.labels.rover", "the rover's rule")];
            self.fault(key, "labels are the rover's, which is a whole rule".into(), cure, &also);
        }
    }
}
