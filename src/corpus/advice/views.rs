//! Kept scans -> what of obstacles each shows: bearing and range of the nearest, and how many stand in view.
//!
//! In: the cells of a scan that hold points of an obstacle, as the label's rule says, each with its range (metres, horizontal, from the sensor),
//! its object and its place in the map; and where the rover is believed to stand. Out: histograms over scans. The nearest is the cell
//! of the least range; its bearing is that of its centre from the rover's middle, against the rover's heading, counter-clockwise. Objects are
//! counted by their ids, the one that each cell names: one that shares all its cells with taller ones is not seen. Not told: what is in no
//! cell, as what lies beyond `cells.max_range_m`.

use std::collections::BTreeSet;
use std::fmt;
use std::ops::AddAssign;

use schemars::JsonSchema;
use serde::Serialize;

use super::share;
use crate::cells::{CellFrame, CellParams};
use crate::geometry::{CellIndex, DVec2, GridSpec, Pose};
use crate::math;

/// Bearings are told in twelve sectors of 30 degrees; the first is centred at straight behind, the seventh straight ahead.
const SECTORS: usize = 12;
const SECTOR_DEG: f64 = 360.0 / SECTORS as f64;
/// Ranges in steps of half a metre; the last bin holds all that is farther.
const RANGE_BINS: usize = 20;
const RANGE_STEP_M: f64 = 0.5;
/// Objects in view: 0 to 9, and more.
const COUNT_BINS: usize = 11;
/// The longest bar, characters.
const BAR: usize = 40;

/// How the cells of a family lie in its map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellGrid {
    pub size_m: f64,
    pub frame: CellFrame,
}

impl From<&CellParams> for CellGrid {
    fn from(params: &CellParams) -> CellGrid {
        CellGrid { size_m: params.size_m, frame: params.frame }
    }
}

impl CellGrid {
    /// A cell's centre, metres ahead of a rover that is believed to stand there in its map, and to its left.
    pub(crate) fn seen_from_rover_m(self, index: CellIndex, pose: &Pose) -> DVec2 {
        // A scan levelled by its own ground lies in a map whose origin and x axis are the rover's.
        let pose = if self.frame == CellFrame::FittedPlane { &Pose::default() } else { pose };
        let away_m = DVec2::from(GridSpec { size_m: self.size_m }.centre_m(index)) - pose.position_m.truncate();
        let (sin, cos) = math::sin_cos(pose.yaw_rad);
        DVec2::new(cos * away_m.x + sin * away_m.y, cos * away_m.y - sin * away_m.x)
    }
}

/// One scan while its cells are read.
#[derive(Clone, Debug, Default)]
pub(crate) struct View {
    nearest: Option<(f32, CellIndex)>,
    objects: BTreeSet<i32>,
}

impl View {
    /// Adds a cell that holds points of an obstacle.
    pub(crate) fn add(&mut self, index: CellIndex, range_m: f32, object: i32) {
        if self.nearest.is_none_or(|(nearest_m, _)| range_m < nearest_m) {
            self.nearest = Some((range_m, index));
        }
        self.objects.insert(object);
    }
}

/// Histograms over the kept scans that were looked at.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub(crate) struct Views {
    pub scans: u64,
    /// Of the nearest obstacle, sectors of 30 degrees from -195 on, so that the seventh is straight ahead; counter-clockwise from the heading.
    /// Scans with an obstacle whose pose is known.
    pub nearest_bearings: [u64; SECTORS],
    /// Of the nearest obstacle, steps of 0.5 m from 0 on; the last holds all that is farther. Scans with an obstacle.
    pub nearest_ranges: [u64; RANGE_BINS],
    /// Scans by distinct obstacles in view: 0 to 9, and more.
    pub obstacles_in_view: [u64; COUNT_BINS],
}

impl Views {
    /// Adds a scan. `at`: where the rover is believed to stand in the map of its cells, and how they lie in it; `None` where that is not known.
    pub(crate) fn add(&mut self, view: &View, at: Option<(&Pose, CellGrid)>) {
        self.scans += 1;
        self.obstacles_in_view[view.objects.len().min(COUNT_BINS - 1)] += 1;
        let Some((range_m, index)) = view.nearest else { return };
        self.nearest_ranges[((f64::from(range_m) / RANGE_STEP_M) as usize).min(RANGE_BINS - 1)] += 1;
        let Some((pose, grid)) = at else { return };
        let place_m = grid.seen_from_rover_m(index, pose);
        let turned_deg = math::atan2(place_m.y, place_m.x).to_degrees() + 180.0 + 0.5 * SECTOR_DEG;
        if turned_deg.is_finite() {
            self.nearest_bearings[(turned_deg / SECTOR_DEG) as usize % SECTORS] += 1;
        }
    }

    /// Share of the scans whose nearest obstacle stands in the commonest sector, and the degrees at that sector's middle; `None` of too few.
    pub(super) fn commonest_bearing(&self, least: u64) -> Option<(f64, f64)> {
        let known: u64 = self.nearest_bearings.iter().sum();
        let (sector, &most) = self.nearest_bearings.iter().enumerate().max_by_key(|(_, count)| **count)?;
        (known >= least).then(|| (share(most, known), SECTOR_DEG * sector as f64 - 180.0))
    }
}

impl AddAssign<&Views> for Views {
    fn add_assign(&mut self, other: &Views) {
        fn add(sum: &mut [u64], other: &[u64]) {
            sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
        }
        self.scans += other.scans;
        add(&mut self.nearest_bearings, &other.nearest_bearings);
        add(&mut self.nearest_ranges, &other.nearest_ranges);
        add(&mut self.obstacles_in_view, &other.obstacles_in_view);
    }
}

/// Bars of `#`, shares of the histogram's own scans; bins behind the last that holds a scan are left out where `ends` says so.
fn bars(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    counts: &[u64],
    ends: bool,
    label: impl Fn(usize) -> String,
) -> fmt::Result {
    let all: u64 = counts.iter().sum();
    if all == 0 {
        return Ok(());
    }
    writeln!(f, "  {title}")?;
    let last = counts.iter().rposition(|count| *count > 0).unwrap_or(0);
    for (bin, &count) in counts.iter().enumerate().take(if ends { last + 1 } else { counts.len() }) {
        let part = share(count, all);
        let bar = "#".repeat((part * BAR as f64).round() as usize);
        writeln!(f, "    {:>12} {:>5.1} % {bar}", label(bin), 100.0 * part)?;
    }
    Ok(())
}

impl fmt::Display for Views {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "what {} kept scans show of obstacles:", self.scans)?;
        bars(f, "bearing of the nearest, degrees (0 ahead, left positive)", &self.nearest_bearings, false, |bin| {
            let to = SECTOR_DEG * (bin as f64 + 0.5) - 180.0;
            // The first sector lies behind, on both sides of 180 degrees.
            let turn = if bin == 0 { 360.0 } else { 0.0 };
            format!("{:.0} to {to:.0}", turn + to - SECTOR_DEG)
        })?;
        bars(f, "range of the nearest, m", &self.nearest_ranges, true, |bin| match bin + 1 {
            RANGE_BINS => format!("over {:.1}", RANGE_STEP_M * bin as f64),
            _ => format!("{:.1} to {:.1}", RANGE_STEP_M * bin as f64, RANGE_STEP_M * (bin + 1) as f64),
        })?;
        bars(f, "obstacles in view", &self.obstacles_in_view, true, |bin| match bin + 1 {
            COUNT_BINS => format!("{bin} or more"),
            _ => bin.to_string(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DVec3;

    const GRID: CellGrid = CellGrid { size_m: 0.1, frame: CellFrame::EstimatedPose };

    /// A view of one obstacle at a bearing, seen from a rover anywhere.
    fn seen(bearing_deg: f64, pose: &Pose, grid: CellGrid) -> Views {
        let angle_rad = pose.yaw_rad + bearing_deg.to_radians();
        let (x_m, y_m) =
            (pose.position_m.x + 5.0 * math::cos(angle_rad), pose.position_m.y + 5.0 * math::sin(angle_rad));
        let mut view = View::default();
        view.add(GridSpec { size_m: 0.1 }.cell(x_m, y_m).unwrap(), 5.0, 3);
        let mut views = Views::default();
        views.add(&view, Some((pose, grid)));
        views
    }

    #[test]
    fn exact_bearings_are_against_the_heading_and_go_round() {
        for yaw_rad in [0.0, 1.0, 3.1, -2.5] {
            let pose = Pose { position_m: DVec3::new(7.0, -3.0, 0.5), yaw_rad, ..Pose::default() };
            for (bearing_deg, sector) in
                [(0.0, 6), (10.0, 6), (-10.0, 6), (20.0, 7), (90.0, 9), (170.0, 0), (-170.0, 0), (-90.0, 3), (-20.0, 5)]
            {
                let views = seen(bearing_deg, &pose, GRID);
                assert_eq!(views.nearest_bearings[sector], 1, "{bearing_deg} at {yaw_rad}: {views:?}");
            }
        }
        // In a levelled map the rover stands at the origin, whatever is believed of its pose.
        let own = Pose { position_m: DVec3::new(7.0, -3.0, 0.5), yaw_rad: 2.0, ..Pose::default() };
        let mut view = View::default();
        view.add(CellIndex { row: 0, col: 30 }, 3.0, 1);
        let mut views = Views::default();
        views.add(&view, Some((&own, CellGrid { frame: CellFrame::FittedPlane, ..GRID })));
        assert_eq!(views.nearest_bearings[6], 1);
    }

    #[test]
    fn exact_the_nearest_counts_and_objects_count_once() {
        let mut view = View::default();
        for (row, range_m, object) in [(3, 1.4, 8), (1, 0.4, 2), (2, 0.6, 2)] {
            view.add(CellIndex { row, col: 0 }, range_m, object);
        }
        let mut views = Views::default();
        views.add(&view, None);
        views.add(&View::default(), None);
        assert_eq!((views.nearest_ranges[0], views.nearest_ranges.iter().sum::<u64>()), (1, 1));
        assert_eq!((views.obstacles_in_view[0], views.obstacles_in_view[2], views.scans), (1, 1, 2));
        assert_eq!(views.nearest_bearings, [0; SECTORS]);
        let mut twice = views.clone();
        twice += &views;
        assert_eq!((twice.scans, twice.obstacles_in_view[2]), (4, 2));
        let said = twice.to_string();
        assert!(said.contains("what 4 kept scans show") && said.contains("0.0 to 0.5 100.0 % ####"), "{said}");
        assert!(said.contains("           2  50.0 % ####################\n") && !said.contains("bearing"), "{said}");
    }

    #[test]
    fn extreme_a_place_that_is_not_finite_has_no_bearing() {
        let nowhere = Pose { yaw_rad: f64::NAN, ..Pose::default() };
        let mut view = View::default();
        view.add(CellIndex { row: 1, col: 1 }, f32::INFINITY, 0);
        let mut views = Views::default();
        views.add(&view, Some((&nowhere, GRID)));
        assert_eq!((views.nearest_bearings, views.nearest_ranges[RANGE_BINS - 1]), ([0; SECTORS], 1));
    }
}
