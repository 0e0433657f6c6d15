//! Learning curves of a report -> grids of the tables: sizes of all settings, of those that were followed to more scenes, and the front.

use super::front::front;
use super::grid::Grid;
use super::report::{CurveRow, Report, Row};
use super::words::{figures, percent, points, shown, told_in_words};

pub(super) fn curves(rows: &[&Row]) -> Grid {
    let cell =
        |size: &CurveRow| format!("{}: {} s, {}", size.scenes, figures(size.cpu_s()), percent(&size.balanced_accuracy));
    let rows = rows.iter().filter_map(|row| {
        let sizes = row.worth.as_ref()?.curve.iter().map(cell);
        Some([row.label()].into_iter().chain(sizes).collect())
    });
    Grid {
        title: "Learning curves: scenes: CPU time, balanced accuracy in %".into(),
        rows: rows.collect(),
        head: vec!["setting", "an eighth", "a quarter", "half", "all"],
    }
}

/// The longer curves, from the last size that they have in common with the others on.
pub(super) fn farther(rows: &[&Row]) -> Option<Grid> {
    let followed =
        rows.iter().filter_map(|row| Some((row, row.worth.as_ref().filter(|worth| !worth.farther.is_empty())?)));
    let sizes = followed.flat_map(|(row, worth)| {
        let gain = worth.farther_gain.as_ref();
        let most = worth.farther.last().map(|size| size.scenes);
        worth.curve.last().into_iter().chain(&worth.farther).map(move |size| {
            let gain = gain.filter(|_| Some(size.scenes) == most);
            vec![
                row.label(),
                size.scenes.to_string(),
                format!("{} + {}", figures(size.generate_cpu_s), figures(size.train_cpu_s)),
                percent(&size.balanced_accuracy),
                percent(&size.missed),
                shown(gain, |gain| format!("{}, {}", gain.scenes, gain.reference_scenes)),
                shown(gain, |gain| points(&gain.balanced_accuracy)),
                shown(gain, |gain| points(&gain.fewer_missed)),
                gain.map_or(String::new(), |gain| told_in_words(gain.told).to_owned()),
            ]
        })
    });
    let rows: Vec<Vec<String>> = sizes.collect();
    let head = vec![
        "setting",
        "scenes",
        "CPU s\ngenerate + train",
        "balanced\naccuracy, %",
        "missed, %\nat 2 % false",
        "at equal CPU,\nreference's",
        "gain,\npoints",
        "fewer missed,\npoints",
        "told",
    ];
    let title = "Farther: what is told better, and the reference, on more scenes".into();
    (!rows.is_empty()).then_some(Grid { title, rows, head })
}

pub(super) fn front_grid(report: &Report) -> Grid {
    let rows = front(report).into_iter().map(|(row, size)| {
        vec![row.label(), size.scenes.to_string(), figures(size.cpu_s()), percent(&size.balanced_accuracy)]
    });
    Grid {
        title: "The front: no other setting and size is both cheaper and more accurate in the mean".into(),
        rows: rows.collect(),
        head: vec!["setting", "scenes", "CPU s, all", "balanced\naccuracy, %"],
    }
}
