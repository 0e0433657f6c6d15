//! Gains at equal CPU -> which setting to build with.
//!
//! Recommended is what is told to be better than the reference, and of several the one that is most accurate for the reference's CPU time.
//! Where nothing is, the config as it is written stays, if it is not told to be worse. What it is worth is told of the most scenes that it was
//! measured at; how many to build is a matter of hours, and of `plan`. Other yards are not recommended, nor poses that no rover knows.

use super::report::{Recommendation, Row, Told};
use super::settings::Side;

/// Places of the rows of a side that may be recommended and are told to be better, the most accurate for the reference's CPU time first.
pub(super) fn better(rows: &[Row], side: Side) -> Vec<usize> {
    let within = |place: &usize| rows[*place].worth.as_ref().and_then(|worth| worth.at_reference_cpu).unwrap_or(0.0);
    // Where some were followed to more scenes, what is told better of the others was not put to that test.
    let is_followed = |row: &Row| row.worth.as_ref().is_some_and(|worth| !worth.farther.is_empty());
    let are_followed = rows.iter().any(|row| row.side == side && is_followed(row));
    let is_better = |place: &usize| {
        let row = &rows[*place];
        let is_told = row.may_be_recommended && row.told() == Some(Told::Better);
        row.side == side && is_told && (is_followed(row) || !are_followed)
    };
    let mut places: Vec<usize> = (0..rows.len()).filter(is_better).collect();
    places.sort_by(|a, b| within(a).total_cmp(&within(b)));
    places.reverse();
    places
}

/// The row that is recommended; `None` where nothing of a side could be measured.
pub(super) fn place(rows: &[Row], side: Side) -> Option<usize> {
    let is_measured = |row: &Row| row.side == side && row.worth.is_some();
    let is_written = |row: &Row| row.may_be_recommended && row.is_as_written() && row.told() != Some(Told::Worse);
    let written = || rows.iter().position(|row| is_measured(row) && is_written(row));
    better(rows, side).first().copied().or_else(written).or_else(|| rows.iter().position(is_measured))
}

/// `None` where nothing of a side could be measured.
pub(super) fn recommend(rows: &[Row], side: Side) -> Option<Recommendation> {
    let row = &rows[place(rows, side)?];
    let size = row.worth.as_ref()?.sizes().next_back()?;
    Some(Recommendation {
        name: row.label(),
        sets: row.sets.clone(),
        is_told_better: !better(rows, side).is_empty(),
        scenes: size.scenes,
        cpu_s: size.cpu_s(),
        balanced_accuracy: size.balanced_accuracy,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::tradeoff::report::{CurveRow, GainRow, WorthRow};
    use crate::measure::tradeoff::settings::Group;
    use crate::statistics::Interval;

    fn row(name: &str, told: Option<Told>, within: f64) -> Row {
        let balanced_accuracy = Interval { mean: within, half_width: 0.01 };
        let gain = told.map(|told| GainRow {
            cpu_s: 1.0,
            scenes: 9,
            reference_scenes: 3,
            balanced_accuracy,
            fewer_missed: balanced_accuracy,
            told,
        });
        let size = |scenes: u64| CurveRow {
            scenes,
            train_rows: 0.0,
            rows_learnt: 0.0,
            generate_cpu_s: scenes as f64,
            train_cpu_s: 0.0,
            learning_cpu_s: 0.0,
            balanced_accuracy,
            by_seed: Vec::new(),
            own: None,
            worst: None,
            missed: Interval { mean: 0.1, half_width: 0.01 },
        };
        Row {
            side: Side::Pipeline,
            group: told.map(|_| Group::Presets),
            name: name.into(),
            sets: vec![name.into()],
            may_be_recommended: name != "truth",
            pipeline: None,
            worth: Some(WorthRow {
                curve: [5, 10, 20, 40].map(size).into(),
                farther: Vec::new(),
                farther_gain: None,
                at_reference_cpu: Some(within),
                gain,
                flat_from: None,
            }),
        }
    }

    fn recommended(rows: &[Row]) -> (String, u64, bool) {
        let of = recommend(rows, Side::Pipeline).expect("a row");
        (of.name, of.scenes, of.is_told_better)
    }

    #[test]
    fn exact_the_most_accurate_of_what_is_told_better_is_recommended_with_its_largest_size() {
        let reference = row("reference", None, 0.95);
        let all = [
            reference.clone(),
            row("one", Some(Told::Better), 0.96),
            row("two", Some(Told::Better), 0.97),
            row("lucky", Some(Told::NotApart), 0.99),
            row("truth", Some(Told::Better), 0.99),
        ];
        assert_eq!(recommended(&all), ("presets: two".into(), 40, true));
        let written = row("as written", Some(Told::NotApart), 0.94);
        assert_eq!(
            recommended(&[reference.clone(), all[3].clone(), written]),
            ("presets: as written".into(), 40, false)
        );
        let worse = row("as written", Some(Told::Worse), 0.9);
        assert_eq!(recommended(&[reference, worse]), ("reference".into(), 40, false));
        assert!(recommend(&all, Side::Trainer).is_none());
        // On more scenes the one is not told apart, and the other was not followed to them.
        let mut followed = all.clone();
        for place in [0, 2] {
            let worth = followed[place].worth.as_mut().unwrap();
            worth.farther = vec![CurveRow { scenes: 320, ..worth.curve[3].clone() }];
            worth.farther_gain = worth.gain.as_ref().map(|gain| GainRow { told: Told::NotApart, ..gain.clone() });
        }
        assert_eq!(recommended(&followed), ("reference".into(), 320, false));
        followed[2].worth.as_mut().unwrap().farther_gain.as_mut().unwrap().told = Told::Better;
        assert_eq!(recommended(&followed), ("presets: two".into(), 320, true));
    }
}
