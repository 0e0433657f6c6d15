//! Reports of corpora whose every number is known.

mod numbers;
mod places;

use super::*;
use crate::cells::params::LabelParams;
use crate::cells::{CellFrame, CellRow, CellTruth, Cells, FeatureColumn, Label, LabelRule, Obstacle};
use crate::corpus::{CorpusSpec, LocalFolder, Place, ShardWriter, Split, Store, Table, finalize};
use crate::episode::{ScanOutput, SceneOutput};
use crate::geometry::CellIndex;
use crate::plan::CardParams;
use crate::scene::Class;
use crate::train::model::tests::{model, with_neurons};
use crate::train::{About, Activation, Model, OperatingPoint, Scaler};

/// Calls a cell untraversable from a height difference of 0.1 m on.
fn steps_model() -> Model {
    let mut model = model(&["height_difference_m"], &[1], true);
    model.network.weights = vec![2.0, 0.0, 10.0, -5.0];
    model.about.scaler = Scaler { minus: vec![None], mean: vec![0.1], scale: vec![0.1], clip: 8.0, scores: Vec::new() };
    model
}

/// One cell of the corpus in the making: label, points, obstacle points, top points, height difference.
type Known = (Option<Label>, i32, i32, i32, f32);

/// Of each scan, in one row: two cells of ground, an obstacle, a missed top, a false alarm.
const SCAN: [Known; 7] = [
    (Some(Label::Traversable), 1, 0, 0, 0.0),
    (Some(Label::Traversable), 6, 0, 0, 0.05),
    (Some(Label::Untraversable), 10, 4, 1, 0.4),
    (Some(Label::Untraversable), 5, 5, 5, 0.02),
    (Some(Label::Traversable), 2, 0, 0, 0.2),
    (None, 9, 0, 0, 0.3),
    (Some(Label::Untraversable), 3, 3, 0, f32::NAN),
];

fn spec(scenes: u64, tables: &[Table]) -> CorpusSpec {
    let feature = |name: &str| FeatureColumn { name: name.into(), unit: "m", description: name.into() };
    CorpusSpec {
        name: "known".into(),
        seed: 1,
        scenes,
        scenes_per_shard: 1,
        tables: tables.to_vec(),
        features: vec![feature("mean_height_m"), feature("height_difference_m")],
        pose_covariance: false,
        by_rover: false,
        poses: false,
        truth: vec![],
        losses: vec![],
        drawn: Vec::new(),
        families: vec!["even".into(), "odd".into()],
        scene_plan_hash: "cd".repeat(32),
        yards: vec!["ef".repeat(32)],
        plan_yaml: format!("marsyard: 1\nname: known\nseed: 1\nscenes: {scenes}\nscenes_per_shard: 1\n"),
        card: CardParams { license: Some("CC0-1.0".into()), ..CardParams::default() },
        facts: Vec::new(),
    }
}

fn scene(scene_id: u64, known: &[Known]) -> SceneOutput {
    let row = |(k, &(label, points, obstacle_points, top_points, _)): (usize, &Known)| CellRow {
        index: CellIndex { row: 0, col: k as i32 },
        label,
        points,
        range_m: 0.5 + k as f32,
        neighbour_mask: 0,
        truth: CellTruth {
            pose: None,
            obstacle_points,
            top_points,
            class: Some(if obstacle_points > 0 { Class::Rock } else { Class::Ground }),
            object: if obstacle_points > 0 { 0 } else { -1 },
            protrusion_m: 0.1 * obstacle_points as f32,
            slope_rad: 0.0,
            crossing: None,
            drop_m: 0.0,
            pit_m: 0.0,
        },
    };
    let cells = Cells {
        rows: known.iter().enumerate().map(row).collect(),
        features: known.iter().flat_map(|cell| [0.0, cell.4]).collect(),
        points_in: 36,
        points_binned: 36,
        dropped_beyond_range: 0,
        dropped_off_grid: 0,
        without_ground: 0,
        overhanging: 0,
    };
    let family = ["even", "odd"][scene_id as usize % 2].into();
    let scans = [0, 1].map(|scan_id| ScanOutput { scan_id, cells: cells.clone(), points: None });
    SceneOutput { scene_id, family, attempts: 1, scans: scans.into(), ..SceneOutput::default() }
}

fn corpus(scenes: u64, tables: &[Table], known: &[Known]) -> (tempfile::TempDir, LocalFolder) {
    let spec = spec(scenes, tables);
    let dir = tempfile::tempdir().unwrap();
    let store = LocalFolder::new(dir.path().join("known"));
    Place::open(&store, &spec).unwrap();
    for shard in 0..spec.shards() {
        let mut writer = ShardWriter::new(&spec, shard).unwrap();
        writer.push(&scene(shard, known)).unwrap();
        writer.finish().unwrap().commit(&store).unwrap();
    }
    finalize(&store, &spec).unwrap();
    (dir, store)
}

fn families() -> Vec<FamilyFacts> {
    let facts = |name: &str, sensor: &str| FamilyFacts {
        name: name.into(),
        hold_out: false,
        sensor: sensor.into(),
        cell_size_m: 0.1,
        local_height: None,
        unseen: None,
        frame: CellFrame::EstimatedPose,
        overhang_m: None,
        labels: LabelParams::default(),
    };
    vec![facts("even", "urg"), facts("odd", "lms")]
}

const TABLES: [Table; 2] = [Table::Cells, Table::Scenes];

#[test]
fn exact_a_report_of_a_corpus_counted_by_hand() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let report = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Test)).unwrap();
    // One test shard (6) with two scans of five cells that can be judged.
    assert_eq!((report.data.scans, report.data.unknown_cells, report.data.not_finite_cells), (2, 2, 2));
    let all = &report.groups[0];
    assert_eq!((all.cells, all.points), (10, 48));
    let at = &all.network.at[0];
    let counts =
        |c: Confusion| [c.true_traversable, c.false_untraversable, c.missed_untraversable, c.true_untraversable];
    assert_eq!(counts(at.cells.counts), [4, 2, 2, 2]);
    assert_eq!(counts(at.points.counts), [14, 4, 10, 20]);
    // The obstacle's cell holds six points of ground, which are called untraversable with it.
    assert_eq!(counts(at.own_points.counts), [14, 16, 10, 8]);
    // The missed cell is all top; the obstacle's cell has one top point.
    assert_eq!(counts(at.cells_without_tops.counts), [4, 2, 0, 2]);
    assert_eq!(counts(at.points_without_tops.counts), [14, 4, 0, 18]);
    assert_eq!(counts(at.own_points_without_tops.counts), [14, 16, 0, 6]);
    let classes: Vec<(&str, [u64; 4])> = report.classes.iter().map(|c| (c.class.as_str(), counts(c.counts))).collect();
    assert_eq!(classes, [("ground", [4, 2, 0, 0]), ("rock", [0, 0, 2, 2])]);
    // The missed top lies between the obstacle and the false alarm: enclosed; nothing is above and below it: not walled in.
    assert_eq!(report.missed_tops[0], MissedTops { cells: 2, enclosed: 2, walled_in: 0 });
    // Outputs rise with the height difference: of six pairs, the top at 0.02 m loses to the ground at 0.05 and 0.2 m.
    assert_eq!(all.network.auc, Some(4.0 / 6.0));
    assert_eq!(all.height_difference.auc, Some(4.0 / 6.0));
}

#[test]
fn exact_groups_are_all_well_seen_family_and_sensor() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let report = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Test)).unwrap();
    let groups = serde_json::to_value(report.groups.iter().map(|g| (&g.group, g.cells)).collect::<Vec<_>>()).unwrap();
    let expected =
        serde_json::json!([["all", 10], [{"points": 3}, 6], [{"family": "even"}, 10], [{"sensor": "urg"}, 10]]);
    assert_eq!(groups, expected);
    let bins: Vec<(f64, u64)> = report.points_per_cell.bins.iter().map(|b| (b.from, b.counts.total())).collect();
    assert_eq!(bins, [(1.0, 2), (2.0, 2), (5.0, 4), (9.0, 2)]);
    let ranges: Vec<(f64, u64)> = report.range_m.bins.iter().map(|b| (b.from, b.counts.total())).collect();
    assert_eq!(ranges, [(0.0, 2), (1.0, 2), (2.0, 2), (3.0, 2), (4.0, 2)]);
    let all = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Train)).unwrap();
    assert_eq!(all.groups.len(), 6, "two families with a sensor each");
    // The report begins with what matters: 14 scans with a missed cell and an untraversable one that is called so.
    let text = all.to_string();
    for line in [
        "missed     50.00 %  ",
        "false      33.33 %  ",
        "precision  50.00 %  ",
        "worst      58.33 %                   balanced accuracy on family even (12 untraversable of 30 cells); mean of 2 families 58.33 %; most missed on even: 50.00 %",
        "in 10 scans of 5 scenes, over which intervals are of 95 %",
    ] {
        assert!(text.contains(line), "{line} in {text}");
    }
    assert!(!report.to_string().contains("worst "), "one family is compared with none");
    assert!(all.notes.iter().any(|note| note.contains("quote the test split")));
}

#[test]
fn exact_one_family_is_judged_alone_by_thresholds_chosen_on_all() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let judged = |only: &[&str]| {
        let only_families = only.iter().map(|name| name.to_string()).collect();
        let options = Options { only_families, ..Options::of(Split::Train) };
        evaluate(&steps_model(), &store, &families(), &options)
    };
    let cells = |report: &Report| report.groups.iter().map(|g| (g.group.clone(), g.cells)).collect::<Vec<_>>();
    let [whole, odd, even] = [&[][..], &["odd"], &["even"]].map(|only| judged(only).unwrap());
    // The train split has five scenes of ten cells: 0, 1, 2, 4 and 5.
    assert_eq!((whole.groups[0].cells, odd.groups[0].cells, even.groups[0].cells), (50, 20, 30));
    let groups = [
        (Group::All, 20),
        (Group::Points(3), 12),
        (Group::Family("odd".into()), 20),
        (Group::Sensor("lms".into()), 20),
    ];
    assert_eq!(cells(&odd), groups);
    assert_eq!((odd.data.scans, odd.data.unknown_cells, odd.missed_tops[0].cells), (4, 4, 4));
    // Validation holds one scene, an odd one; the thresholds of `even` come from there all the same.
    assert_eq!((&even.thresholds, even.height_threshold_m), (&whole.thresholds, whole.height_threshold_m));
    assert_eq!(even.thresholds.len(), 2);
    assert!(odd.notes.iter().any(|note| note.contains("scenes of odd alone")), "{:?}", odd.notes);
    assert_eq!(cells(&judged(&["odd", "even"]).unwrap()), cells(&whole));
    let error = judged(&["oud"]).unwrap_err().to_string();
    assert_eq!(error, "the corpus has no family 'oud'; it has even, odd");
}

#[test]
fn law_thresholds_are_chosen_on_the_validation_split() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let report = evaluate(&steps_model(), &store, &[], &Options::of(Split::Test)).unwrap();
    assert_eq!(report.thresholds.len(), 2);
    assert_eq!(report.thresholds[1].origin, ThresholdOrigin::Validation);
    let height = report.height_threshold_m.unwrap();
    // Above 0.2 m there is the obstacle alone; from 0.02 m on there are both obstacles and two of three ground cells.
    assert!((0.2..=0.4).contains(&height.value), "{}", height.value);
    let chosen = &report.groups[0].height_difference.at[0];
    assert_eq!(chosen.cells.counts.missed_untraversable, 2);
    let own = evaluate(&steps_model(), &store, &[], &Options::of(Split::Validation)).unwrap();
    assert!(own.notes.iter().any(|note| note.contains("flatter")), "{:?}", own.notes);
}

#[test]
fn exact_labels_of_another_rover_come_from_the_truth_columns() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let rule = LabelRule { obstacle: Obstacle::TallerThanM(0.45), ..LabelRule::default() };
    let options = Options { labels: Some(rule), ..Options::of(Split::Test) };
    let report = evaluate(&steps_model(), &store, &families(), &options).unwrap();
    // The obstacle of four points stands 0.4 m: traversable now. The one of five points stands 0.5 m.
    let counts = report.groups[0].network.at[0].cells.counts;
    assert_eq!((counts.untraversable(), counts.traversable()), (2, 8));
    assert!(report.data.labels.contains("taller_than_m"), "{}", report.data.labels);
}

#[test]
fn extreme_bad_input_is_refused_with_the_cure() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let error = |model: &Model, families: &[FamilyFacts], options: &Options| {
        evaluate(model, &store, families, options).unwrap_err().to_string()
    };
    let test = Options::of(Split::Test);
    let other = error(&model(&["height_difference_m", "intensity_mean"], &[2], true), &families(), &test);
    assert!(other.contains("the model takes intensity_mean, which the data does not have"), "{other}");
    let mut large = families();
    large[1].cell_size_m = 0.2;
    let size = error(&steps_model(), &large, &test);
    assert!(size.contains("family 'odd'") && size.contains("cells of 0.1 m, the data has cells of 0.2 m"), "{size}");
    let odd =
        error(&steps_model(), &[], &Options { point: OperatingPoint::Thresholds(vec![0.7, 0.2]), ..test.clone() });
    assert!(odd.contains("rising numbers"), "{odd}");
}

#[test]
fn extreme_damaged_and_foreign_files_are_refused_with_their_names_before_a_row_is_judged() {
    let (dir, store) = corpus(7, &TABLES, &SCAN);
    let test = Options::of(Split::Test);
    for table in [Table::Cells, Table::Scenes] {
        let path = table.path(6);
        let whole = store.read(&path).unwrap();
        let told_after = |bytes: &[u8]| {
            store.replace(&path, bytes).unwrap();
            let told = evaluate(&steps_model(), &store, &[], &test).unwrap_err().to_string();
            assert!(told.contains(&path) && told.contains("marsyard verify"), "{told}");
            told
        };
        assert!(told_after(&whole[..whole.len() / 2]).contains("shards.jsonl says"));
        let mut flipped = whole.clone();
        flipped[whole.len() / 2] ^= 1;
        assert!(told_after(&flipped).contains("sha256"));
        assert!(told_after(&vec![7; whole.len()]).contains("sha256"));
        std::fs::remove_file(dir.path().join("known").join(&path)).unwrap();
        let gone = evaluate(&steps_model(), &store, &[], &test).unwrap_err().to_string();
        assert!(gone.contains(&path) && gone.contains("it is missing"), "{gone}");
        store.replace(&path, &whole).unwrap();
    }
    evaluate(&steps_model(), &store, &[], &test).unwrap();
}

#[test]
fn law_of_several_damaged_shards_the_first_is_named_and_threads_change_no_report() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let train = Options::of(Split::Train);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| evaluate(&steps_model(), &store, &families(), &train))
    };
    let report = on(1).unwrap();
    assert!(report.data.scans > 5 && on(3).unwrap() == report);
    for damaged in [vec![4], vec![1, 4]] {
        damaged.iter().for_each(|shard| store.replace(&Table::Cells.path(*shard), b"short").unwrap());
        for threads in [1, 3] {
            let told = on(threads).unwrap_err().to_string();
            assert!(told.contains(&Table::Cells.path(damaged[0])), "{told}");
        }
    }
}

#[test]
fn extreme_empty_splits_and_one_class_give_no_numbers_rather_than_wrong_ones() {
    let (_dir, store) = corpus(2, &TABLES, &SCAN);
    let error = evaluate(&steps_model(), &store, &[], &Options::of(Split::Test)).unwrap_err().to_string();
    assert!(error.contains("the test split holds no cell with a known label"), "{error}");
    let unknown: Vec<Known> =
        SCAN.iter().map(|&(_, points, obstacle, top, height)| (None, points, obstacle, top, height)).collect();
    let (_dir, store) = corpus(7, &TABLES, &unknown);
    assert!(evaluate(&steps_model(), &store, &[], &Options::of(Split::Test)).is_err());
    let (_dir, store) = corpus(7, &[Table::Cells], &SCAN[..2]);
    let report = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Test)).unwrap();
    let at = &report.groups[0].network.at[0];
    assert_eq!(
        (at.cells.rates.mcc, at.cells.rates.balanced_accuracy, report.groups[0].network.auc),
        (None, None, None)
    );
    assert_eq!(at.cells.rates.false_untraversable, Some(0.0));
    assert_eq!(report.groups.len(), 2, "no scenes table, no families");
    assert!(report.notes.iter().any(|note| note.contains("no threshold was chosen")));
    let text = report.to_string() + &report.to_json();
    assert!(!text.contains("NaN"), "{text}");
    // Probabilities are worth something without a second class, a ROC curve is not.
    assert!(figures::figures(&report).iter().all(|(name, _)| *name != "roc.svg"));
}

#[test]
fn law_reports_are_read_back_and_show_every_figure() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let report = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Test)).unwrap();
    let back: Report = serde_json::from_str(&report.to_json()).unwrap();
    assert_eq!(back, report);
    let figures = figures::figures(&report);
    let names: Vec<&str> = figures.iter().map(|(name, _)| *name).collect();
    assert_eq!(
        names,
        ["confusion.svg", "error-against-points.svg", "error-against-range.svg", "roc.svg", "reliability.svg"]
    );
    let uncalibrated = Model { about: About { calibration: None, ..steps_model().about }, ..steps_model() };
    let plain = evaluate(&uncalibrated, &store, &families(), &Options::of(Split::Test)).unwrap();
    assert!(plain.doubt.is_none() && plain.groups.iter().all(|group| group.probabilities.is_none()));
    assert!(figures::figures(&plain).iter().all(|(name, _)| *name != "reliability.svg"));
    assert!(!plain.to_string().contains("doubtful") && report.to_string().contains("doubtful"));
    assert!(figures.iter().all(|(_, svg)| svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>")));
}

#[test]
fn exact_neurons_that_are_not_logistic_are_told_and_reports_from_before_had_none() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let of = |model: &Model| evaluate(model, &store, &families(), &Options::of(Split::Test)).unwrap();
    assert!(of(&steps_model()).to_string().contains(" 1 network, 1 inputs, 4 weights"));
    let rectified = of(&with_neurons(Activation::Relu, steps_model()));
    assert!(rectified.to_string().contains(" 1 network of rectified neurons, 1 inputs, 4 weights"), "{rectified}");
    let mut json: serde_json::Value = serde_json::from_str(&rectified.to_json()).unwrap();
    assert_eq!(json["model"].as_object_mut().unwrap().remove("activation").unwrap(), "relu");
    let before: Report = serde_json::from_value(json).unwrap();
    assert_eq!(before.model.activation, Activation::Logistic);
}

/// The value of an attribute of an SVG element.
fn attribute(element: &str, name: &str) -> String {
    let value = element.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
    value.unwrap_or_else(|| panic!("no {name} in {element}")).to_string()
}

fn place_of(element: &str) -> [f64; 2] {
    ["x", "y"].map(|name| attribute(element, name).parse().unwrap())
}

/// Elements of a kind, each with the words that it holds.
fn elements<'a>(svg: &'a str, kind: &'a str) -> impl Iterator<Item = (&'a str, &'a str)> {
    svg.split('<').filter(move |element| element.starts_with(kind)).map(|element| {
        let (head, words) = element.split_once('>').unwrap();
        (head, words.trim())
    })
}

fn figure_texts() -> (Report, std::collections::BTreeMap<&'static str, String>) {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let report = evaluate(&steps_model(), &store, &families(), &Options::of(Split::Test)).unwrap();
    let figures = figures::figures(&report).into_iter().collect();
    (report, figures)
}

#[test]
fn exact_the_confusion_figure_says_each_count_in_its_field() {
    let (_, figures) = figure_texts();
    let svg = &figures["confusion.svg"];
    let side = |element: &str, name: &str| -> f64 { attribute(element, name).parse().unwrap() };
    let fields: Vec<&str> =
        elements(svg, "rect").map(|(head, _)| head).filter(|head| side(head, "width") < 700.0).collect();
    assert_eq!(fields.len(), 4);
    let within = |field: &str, [x, y]: [f64; 2]| {
        let [left, top] = place_of(field);
        (left..left + side(field, "width")).contains(&x) && (top..top + side(field, "height")).contains(&y)
    };
    // Of 6 traversable cells 4 are called so, of 4 untraversable ones 2; writing is white on fields of more than 55 %.
    let expected =
        [("4", "66.67", "#FFFFFF"), ("2", "33.33", "#000000"), ("2", "50.00", "#000000"), ("2", "50.00", "#000000")];
    for (field, (count, percent, ink)) in fields.iter().zip(expected) {
        let said: Vec<(&str, &str)> = elements(svg, "text").filter(|(head, _)| within(field, place_of(head))).collect();
        assert_eq!(
            said.iter().map(|(_, words)| *words).collect::<Vec<_>>(),
            [count, &format!("{percent} % of its row")]
        );
        assert!(said.iter().all(|(head, _)| attribute(head, "fill") == ink), "{said:?}");
    }
    // Left of each row its name, under the word "truly", within the row's height and below the head.
    let rows = [fields[0], fields[2]].map(|field| (place_of(field)[1], side(field, "height")));
    let labels: Vec<[f64; 2]> =
        elements(svg, "text").filter(|(_, words)| *words == "truly").map(|(head, _)| place_of(head)).collect();
    let head_y = elements(svg, "text")
        .find(|(_, words)| *words == "called traversable")
        .map(|(head, _)| place_of(head)[1])
        .unwrap();
    for (((top, height), truly), name) in rows.into_iter().zip(labels).zip(["traversable", "untraversable"]) {
        let named = elements(svg, "text").find(|(_, words)| *words == name).map(|(head, _)| place_of(head)).unwrap();
        assert!(top > head_y && top + height <= 420.0, "{top}");
        assert!(truly[1] > top && named[1] > truly[1] + 10.0 && named[1] < top + height, "{truly:?} {named:?}");
        assert_eq!(truly[0], named[0]);
    }
}

#[test]
fn exact_the_error_figures_name_their_bins_and_the_legends_stand_beside_their_words() {
    let (report, figures) = figure_texts();
    let svg = &figures["error-against-range.svg"];
    for bin in &report.range_m.bins {
        let name = bin.to.map_or(format!("{}+", bin.from), |to| format!("{}-{to}", bin.from));
        assert!(elements(svg, "text").any(|(_, words)| words == name), "{name}");
    }
    for words in ["false_untraversable", "missed_untraversable"] {
        let at = elements(svg, "text").find(|(_, there)| *there == words).map(|(head, _)| place_of(head)).expect(words);
        let key = elements(svg, "rect").map(|(head, _)| head).find(|head| {
            let [x, y] = place_of(head);
            attribute(head, "width") == "12"
                && attribute(head, "height") == "10"
                && x < at[0]
                && (y - at[1]).abs() < 12.0
        });
        assert!(key.is_some(), "a key beside {words} at {at:?}: {svg}");
    }
    // Of the curves' legend each key is a line of 14 pixels that ends before its words begin.
    let svg = &figures["roc.svg"];
    for words in ["network, AUC", "height difference, AUC"] {
        let at = elements(svg, "text")
            .find(|(_, there)| there.starts_with(words))
            .map(|(head, _)| place_of(head))
            .expect(words);
        let key = elements(svg, "polyline").map(|(head, _)| attribute(head, "points")).find(|points| {
            let numbers: Vec<f64> = points.split([' ', ',']).filter_map(|number| number.parse().ok()).collect();
            matches!(numbers[..], [x, y, right, level]
                if right == x + 14.0 && y == level && right <= at[0] && (y - at[1]).abs() < 14.0)
        });
        assert!(key.is_some(), "a key beside {words} at {at:?}: {svg}");
    }
}

#[test]
fn exact_families_of_a_frame_or_rule_that_the_model_never_learnt_are_named_in_the_notes() {
    let (_dir, store) = corpus(7, &TABLES, &SCAN);
    let notes = |families: &[FamilyFacts], only: &[&str]| {
        let only_families = only.iter().map(|name| name.to_string()).collect();
        let options = Options { only_families, ..Options::of(Split::Test) };
        evaluate(&steps_model(), &store, families, &options).unwrap().notes
    };
    let about =
        |notes: &[String], word: &str| notes.iter().filter(|note| note.contains(word)).cloned().collect::<Vec<_>>();
    let (frame, rule) = ("the frame fitted_plane", "0.8 m of free height");
    assert!(about(&notes(&families(), &[]), frame).is_empty() && about(&notes(&families(), &[]), rule).is_empty());
    let mut mixed = families();
    mixed[1].frame = CellFrame::FittedPlane;
    mixed[0].overhang_m = Some(0.8);
    let told = notes(&mixed, &[]);
    assert!(about(&told, frame)[0].starts_with("odd: the model learnt cells of the frame estimated_pose"), "{told:?}");
    assert!(about(&told, rule)[0].starts_with("even: the model learnt cells with all that hangs"), "{told:?}");
    // Of families that are not judged nothing is told; where all are alike none is named.
    assert!(about(&notes(&mixed, &["even"]), frame).is_empty());
    mixed.iter_mut().for_each(|family| family.frame = CellFrame::FittedPlane);
    assert!(about(&notes(&mixed, &[]), frame)[0].starts_with("the model learnt cells of the frame"));
}
