//! The returns of one sweep, seen from its sensor -> which of them hang so high over beams that the rover fits beneath:
//! `cells.overhang`.
//!
//! In: places of returns from the sensor, along the axes of the map, metres. Out: a mark for each. Own construction. The returns are laid
//! into columns of [`COLUMN_RAD`] around the sensor. A beam that came back from behind a return, in its column, has passed
//! beneath or above it: along the straight line from the sensor. A return hangs where [`WITNESSES`] others of its column, none nearer
//! than itself, have lines more than `above_m` beneath it. So the free height is seen and not supposed: crowns over ground that nobody
//! saw leave, on slopes too; the top of a boulder or of a bank does not, because nothing is seen beneath it; of a wall or a trunk what
//! is higher than `above_m` over its foot leaves, and the foot stays. One stray return far below the ground is one witness, and marks
//! nothing.
//!
//! Corpora and `classify` both come here, with the points of one sweep at a time. Not modelled: beams that met nothing, which a cloud does
//! not tell of: what hangs before an empty sky and over no ground stays.

use super::WindowCloud;
use crate::geometry::{DVec3, Transform};
use crate::math;
use crate::sweep::{Returns, Status};

/// In a whole turn: of 4 degrees, wide enough that beams beside a trunk speak for the crown behind it. Measured on orchards, 0.5 degrees leave half of
/// the crowns' cells standing that 4 degrees take away, and walls, boxes and rocks keep theirs at either.
const COLUMNS: u32 = 90;
/// Width of a column.
const COLUMN_RAD: f64 = std::f64::consts::TAU / COLUMNS as f64;
/// Other returns that must have passed beneath.
const WITNESSES: usize = 2;

/// Which returns of a sweep or cloud hang; with reused memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Overhangs {
    /// From the sensor, along the map's axes; not finite where there is no return.
    places_m: Vec<DVec3>,
    /// One for each return in a column that may hold something that hangs.
    lines: Vec<Line>,
    /// Whether a column may.
    columns: Vec<bool>,
    hanging: Vec<bool>,
}

/// The line from the sensor to a return.
#[derive(Clone, Copy, Debug)]
struct Line {
    column: u32,
    range_m: f64,
    slope: f64,
    number: u32,
}

impl Overhangs {
    /// A mark for each slot of a sweep.
    pub(crate) fn of_sweep(&mut self, above_m: f64, returns: &Returns, map_from_sensor: &Transform) -> &[bool] {
        self.places_m.clear();
        let slots = returns.status.iter().zip(&returns.range_m).zip(&returns.pattern.directions);
        self.places_m.extend(slots.map(|((&status, &range_m), &direction)| match status {
            Status::Hit => map_from_sensor.direction(direction * range_m),
            _ => DVec3::NAN,
        }));
        self.find(above_m)
    }

    /// A mark for each point of a cloud.
    pub(crate) fn of_cloud(&mut self, above_m: f64, cloud: &WindowCloud) -> &[bool] {
        self.places_m.clear();
        let WindowCloud { in_map, map_from_sensor, .. } = cloud;
        let place_m = |&point_m: &DVec3| match in_map {
            true => point_m - map_from_sensor.translation_m,
            false => map_from_sensor.direction(point_m),
        };
        self.places_m.extend(cloud.points_m.iter().map(place_m));
        self.find(above_m)
    }

    fn find(&mut self, above_m: f64) -> &[bool] {
        let Overhangs { places_m, lines, columns, hanging } = self;
        hanging.clear();
        hanging.resize(places_m.len(), false);
        let finite = || places_m.iter().enumerate().filter(|(_, place_m)| place_m.is_finite());
        // A line from the sensor is nowhere lower than at its lower end.
        let lowest_m = finite().map(|(_, place_m)| place_m.z).fold(0.0, f64::min);
        columns.clear();
        for (_, &place_m) in finite().filter(|(_, place_m)| place_m.z - lowest_m > above_m) {
            let column = column(place_m) as usize;
            columns.resize(columns.len().max(column + 1), false);
            columns[column] = true;
        }
        if columns.is_empty() {
            return hanging;
        }
        lines.clear();
        lines.extend(finite().filter_map(|(number, &place_m)| {
            let column = column(place_m);
            let range_m = math::hypot(place_m.x, place_m.y);
            let line = Line { column, range_m, slope: place_m.z / range_m, number: number as u32 };
            (columns.get(column as usize) == Some(&true)).then_some(line)
        }));
        // From far to near, and of equals from below: when a return is asked, all that is behind or beneath it is known.
        lines.sort_unstable_by(|a, b| {
            let by_range = b.range_m.total_cmp(&a.range_m).then(a.slope.total_cmp(&b.slope));
            a.column.cmp(&b.column).then(by_range).then(a.number.cmp(&b.number))
        });
        for column in lines.chunk_by(|a, b| a.column == b.column) {
            let mut lowest = [f64::INFINITY; WITNESSES];
            for line in column {
                // With too few witnesses this is less than any height, and at a range of 0 not a number.
                hanging[line.number as usize] = (line.slope - lowest[WITNESSES - 1]) * line.range_m > above_m;
                if let Some(at) = lowest.iter().position(|&slope| line.slope < slope) {
                    lowest[at..].rotate_right(1);
                    lowest[at] = line.slope;
                }
            }
        }
        hanging
    }
}

fn column(place_m: DVec3) -> u32 {
    // What lies straight behind is in the first column, on whichever side of the half turn it is read.
    ((math::atan2(place_m.y, place_m.x) + std::f64::consts::PI) / COLUMN_RAD) as u32 % COLUMNS
}
