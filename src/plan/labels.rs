//! The labels of a plan's families -> what is to be said where those that are learnt from label by unlike rules.
//!
//! In: families. Out: what their rules differ in, and what to do about it. No column holds a rule: a cell that one family's rule calls an
//! obstacle and another's does not is one for no reason that could be learnt. Such a corpus is legal, for `train --labels` makes of it a
//! network for each rover. Not looked at: plants that are marked untraversable in some families, which look like other plants to no sensor.

use super::Family;
use crate::cells::params::ObstacleRule;

/// What differs between families that are learnt from, and the cure; `None` where all label alike.
pub(crate) fn unlike_labels<'f>(families: impl Iterator<Item = &'f Family>) -> Option<[String; 2]> {
    let all: Vec<&Family> = families.filter(|family| family.is_learnt()).collect();
    let first = all.first()?;
    if all.iter().all(|family| family.cells.labels.rover.is_none()) {
        return unlike_limits(&all);
    }
    let judged_by = |family: &'f Family| {
        let rover = &family.drive.rover;
        (
            &family.cells.labels.rover,
            &rover.chassis,
            rover.wheel_diameter_m,
            rover.length_m,
            rover.width_m,
            &rover.limits,
        )
    };
    all.iter().any(|family| judged_by(family) != judged_by(first)).then(|| {
        let rule = "labels go by what a rover can cross (cells.labels.rover), not by the same rover and rule in all families, and no column tells a \
                    network which";
        [rule.into(), "give all families one rover and one cells.labels, or build a corpus for each rover".into()]
    })
}

/// The same of families that no rover judges.
fn unlike_limits(all: &[&Family]) -> Option<[String; 2]> {
    let labels = || all.iter().map(|family| &family.cells.labels);
    // Where all are obstacles the height is 0.
    let height_m =
        |family: &Family| family.cells.labels.obstacle.height_m(family.drive.rover.wheel_diameter_m).unwrap_or(0.0);
    let heights_m = Values::of(all.iter().map(|family| Some(height_m(family))));
    let slopes_deg = Values::of(labels().map(|labels| labels.max_ground_slope_deg));
    let drops_m = Values::of(labels().map(|labels| labels.max_drop_m));
    let points = Values::of(labels().map(|labels| Some(f64::from(labels.min_obstacle_points))));
    let go_by_wheel = labels().all(|labels| labels.obstacle == ObstacleRule::TallerThanWheel);
    let count = heights_m.0.len();
    let heights =
        if go_by_wheel { format!("the wheels of {count} rovers") } else { format!("{count} heights of obstacles") };
    let unlike: Vec<String> = [
        (heights.as_str(), &heights_m, " m"),
        ("unlike slopes of the ground", &slopes_deg, " degrees"),
        ("unlike drops", &drops_m, " m"),
        ("unlike counts of points", &points, ""),
    ]
    .into_iter()
    .filter(|(_, values, _)| values.differ())
    .map(|(what, values, unit)| format!("{what} ({})", values.words(unit)))
    .collect();
    if unlike.is_empty() {
        return None;
    }
    let between = match heights_m.0[..] {
        [Some(smallest_m), .., Some(largest_m)] => {
            format!(
                "what stands between {smallest_m} and {largest_m} m tall is an obstacle in some families and none in others"
            )
        }
        _ => "what looks the same is traversable in some families and not in others".into(),
    };
    let rule = format!("labels go by {}, and no column tells a network which: {between}", unlike.join(" and "));
    if points.0 != [Some(1.0)] {
        return Some([
            rule,
            "give all families one rover and one cells.labels: train --labels counts no points".into(),
        ]);
    }
    let obstacle = match heights_m.0[..] {
        [Some(height_m)] if go_by_wheel => format!("taller_than_wheel={height_m}"),
        [Some(height_m)] if height_m > 0.0 => format!("taller_than_m={height_m}"),
        [_] => "all".into(),
        _ => "taller_than_wheel=DIAMETER_M".into(),
    };
    // Of two corpora one may lack what tells drops: a rule by them would be refused.
    let drops = if drops_m.0.contains(&None) { String::new() } else { drops_m.typed("max_drop_m", "METRES") };
    let limits = slopes_deg.typed("max_ground_slope_deg", "DEGREES") + &drops;
    let whose = if heights_m.differ() {
        "give all families the rover that the network is for, or train it for that rover's wheel"
    } else {
        "give all families one cells.labels, or train by one"
    };
    Some([rule, format!("{whose}: marsyard train --labels {obstacle}{limits}")])
}

/// What families have for one limit, each once, from the smallest on; `None`: no limit.
struct Values(Vec<Option<f64>>);

impl Values {
    fn of(values: impl Iterator<Item = Option<f64>>) -> Values {
        let mut values: Vec<Option<f64>> = values.collect();
        let key = |value: &Option<f64>| value.unwrap_or(f64::INFINITY);
        values.sort_by(|a, b| key(a).total_cmp(&key(b)));
        values.dedup();
        Values(values)
    }

    fn differ(&self) -> bool {
        self.0.len() > 1
    }

    fn words(&self, unit: &str) -> String {
        let numbers: Vec<String> = self.0.iter().flatten().map(f64::to_string).collect();
        let none = if self.0.contains(&None) { ", none" } else { "" };
        format!("{}{unit}{none}", numbers.join(", "))
    }

    /// As a part of `--labels`, with a place to fill in where families differ; nothing where none has the limit.
    fn typed(&self, key: &str, place: &str) -> String {
        match self.0[..] {
            [None] => String::new(),
            [Some(value)] => format!(",{key}={value}"),
            _ => format!(",{key}={place}"),
        }
    }
}
