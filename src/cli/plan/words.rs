//! A plan in words: what a family models, and what no family names.

use crate::cells::CellFrame;
use crate::cells::params::{BeamParams, CurvatureParams, SurroundingsParams};
use crate::cli::progress::counted;
use crate::drive::params::Keep;
use crate::measure::estimate::Part;
use crate::plan::Plan;
use crate::random::{Dist, Law};
use crate::scene::params::{GroundShape, GroundSource};
use crate::slam::SlamParams;
use crate::sweep::params::Cast;

/// Values of a choice that are listed.
const MOST_VALUES: usize = 6;

/// The parts a family switches on, in the order of the flow.
pub(super) fn parts(plan: &Plan, index: usize) -> Vec<(&'static str, String)> {
    let family = &plan.families[index];
    let mut parts = Vec::new();
    let scene = &family.scene;
    let source = match &scene.ground.source {
        GroundSource::Random(r) => {
            format!("random, rms {} m, correlation length {} m", say(&r.rms_height_m), say(&r.correlation_length_m))
        }
        GroundSource::File(f) => format!("from {}", f.path),
        GroundSource::Flat => "flat".into(),
    };
    let shape = match &scene.ground.shape {
        GroundShape::Polynomial(p) => format!("polynomial of degree {}", p.degree),
        GroundShape::Raw(r) => format!("raw at {} m", r.spacing_m),
    };
    parts.push(("ground", format!("{} m square, {source}; {shape}", scene.extent_m)));
    if let Some(r) = &scene.ground.roughness {
        parts.push(("roughness", format!("rms {} m at {} m", say(&r.rms_height_m), say(&r.correlation_length_m))));
    }
    if !scene.ground.features.is_empty() {
        parts.push(("landforms", counted(scene.ground.features.len() as u32, "kind")));
    }
    if let Some(rocks) = &scene.rocks {
        let detail = match (&rocks.golombek, &rocks.count, &rocks.diameter_m) {
            (Some(g), _, _) => format!("Golombek abundance {} from {} m up", say(&g.abundance), g.min_diameter_m),
            (None, Some(n), Some(d)) => format!("{} of {} m", say(n), say(d)),
            _ => String::new(),
        };
        parts.push(("rocks", detail));
    }
    if let Some(boxes) = &scene.boxes {
        parts.push(("boxes", say(&boxes.count)));
    }
    if let Some(trees) = &scene.trees {
        parts.push((
            "trees",
            format!("{}{}", say(&trees.count), if trees.crown.is_some() { ", with crowns" } else { "" }),
        ));
    }
    if let Some(v) = &scene.vegetation {
        let kinds = [("grass", v.grass.is_some()), ("brush", v.brush.is_some()), ("bushes", v.bushes.is_some())];
        let on: Vec<_> = kinds.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
        parts.push(("vegetation", on.join(", ")));
    }
    let drive = &family.drive;
    parts.push((
        "rover",
        format!(
            "{}, {}, {}{}",
            drive.rover.name,
            counted(drive.stops, "stop"),
            kept(drive.keep),
            if drive.attempts > 1 { format!(", up to {} attempts", drive.attempts) } else { String::new() }
        ),
    ));
    let cast = match &family.sweep.cast {
        Cast::Exact => "cast exactly".to_string(),
        Cast::Raster(s) => format!("cast on a raster of {} m", s.spacing_m),
        Cast::Mesh(s) => format!("cast on a mesh of {} m", s.spacing_m),
    };
    let sensor = &family.sweep.sensor;
    parts.push(("sensor", format!("{}, {} to {} m, {cast}", sensor.name, sensor.min_range_m, sensor.max_range_m)));
    let on = Part::ALL.into_iter().filter(|part| part.is_beam_effect() && part.is_on(plan, index));
    let on: Vec<_> = on.map(Part::name).collect();
    parts.push(("effects", if on.is_empty() { "none".into() } else { on.join(", ") }));
    let slam = match &family.slam {
        SlamParams::Fastslam(f) => format!("FastSLAM 2.0, {} particles", f.particles),
        SlamParams::Registration(r) => format!("sweeps laid on one another, up to {} m", r.range_m),
        SlamParams::DeadReckoning => "dead reckoning".into(),
        SlamParams::Surrogate(_) => "surrogate: truth plus noise".into(),
        SlamParams::Truth => "truth".into(),
    };
    parts.push(("slam", slam));
    let cells = &family.cells;
    let sweeps =
        if cells.window_scans > 1 { format!("{} sweeps together", cells.window_scans) } else { "one sweep".into() };
    parts.push(("cells", format!("{} m, {} neighbours, {sweeps}", cells.size_m, cells.neighbours)));
    if cells.frame == CellFrame::FittedPlane {
        parts.push(("frame", "levelled by a fitted plane".into()));
    }
    if let Some(overhang) = &cells.overhang {
        parts.push(("overhang", format!("without {}", overhang.words())));
    }
    let around = [
        cells.local_height.as_ref().map(|local| format!("height above {}", local.words())),
        cells.curvature.as_ref().map(CurvatureParams::words),
        cells.surroundings.as_ref().map(SurroundingsParams::words),
        cells.beams.as_ref().map(BeamParams::words),
    ];
    let around: Vec<String> = around.into_iter().flatten().collect();
    if !around.is_empty() {
        parts.push(("around a cell", around.join(", ")));
    }
    if let Some(unseen) = &cells.unseen {
        parts.push(("unseen cells", unseen.words()));
    }
    parts
}

/// Parts that no family names; registration and dead reckoning are choices among pose estimates and no parts of their own.
pub(super) fn absent(plan: &Plan) -> Vec<&'static str> {
    let is_absent = |part: &Part| (0..plan.families.len()).all(|family| !part.is_on(plan, family));
    let is_choice = |part: &Part| matches!(part, Part::Registration | Part::DeadReckoning);
    let absent = Part::ALL.into_iter().filter(|part| !is_choice(part) && is_absent(part));
    absent.map(Part::name).collect()
}

/// What taught networks most about mixed.yaml's families held out, in the mean of them and on the worst (docs/accuracy.md), and its key.
const TEACH_MOST: [(Part, &str); 2] =
    [(Part::Grass, "scene.vegetation.grass"), (Part::Landforms, "scene.ground.features")];

/// How yards that teach no more could be varied.
pub(super) fn how_to_vary(plan: &Plan) -> String {
    let absent = absent(plan);
    // Where all rocks lie as on a planet, nothing grows.
    let is_bare =
        plan.families.iter().all(|family| family.scene.rocks.as_ref().is_some_and(|rocks| rocks.golombek.is_some()));
    let could_be = |(part, _): &(Part, &str)| absent.contains(&part.name()) && !(is_bare && *part == Part::Grass);
    let missing: Vec<String> =
        TEACH_MOST.into_iter().filter(could_be).map(|(part, key)| format!("{} ({key})", part.name())).collect();
    match missing.as_slice() {
        [] => "add `families` whose scene.ground, rocks or vegetation differ from these, such as those of the ground that the rover will drive on".into(),
        missing => format!(
            "they are without {}, which taught most about the families that mixed.yaml holds out",
            missing.join(" and ")
        ),
    }
}

/// Which sweeps are written.
fn kept(keep: Keep) -> String {
    match keep {
        Keep::Last => "the last one kept".into(),
        Keep::All | Keep::Every(1) => "all kept".into(),
        Keep::Every(2) => "every second one kept".into(),
        Keep::Every(n) => format!("every {n}{} one kept", ordinal_ending(n)),
    }
}

/// Of 3rd, 11th, 21st ...
fn ordinal_ending(n: u32) -> &'static str {
    match (n % 10, n % 100) {
        (_, 11..=13) => "th",
        (1, _) => "st",
        (2, _) => "nd",
        (3, _) => "rd",
        _ => "th",
    }
}

/// A constant or a law in a few words.
fn say(dist: &Dist) -> String {
    let law = match dist {
        Dist::Constant(value) => return format!("{value}"),
        Dist::Law(law) => law,
    };
    let (low, high) = law.bounds();
    match law {
        _ if low == high => format!("{low}"),
        Law::Choice(values) if values.len() <= MOST_VALUES => {
            format!("one of {}", values.iter().map(f64::to_string).collect::<Vec<_>>().join(", "))
        }
        Law::Choice(values) => format!("one of {} values from {low} to {high}", values.len()),
        Law::Weighted(pairs) => format!("one of {} weighted values from {low} to {high}", pairs.len()),
        Law::Uniform(_) | Law::LogUniform(_) | Law::Normal { .. } => format!("{low} to {high}"),
        Law::Poisson { mean, .. } => format!("some {mean} (poisson)"),
        law => format!("{low} to {high} ({})", law.name()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_grass_is_advised_where_it_could_grow() {
        let advised = |name: &str| {
            let config = std::path::Path::new("configs").join(name);
            how_to_vary(&crate::config::load(&config, &[]).expect("a shipped config"))
        };
        assert!(advised("paper.yaml").contains("without grass (scene.vegetation.grass) and landforms"));
        assert!(!advised("mars.yaml").contains("grass"));
    }

    #[test]
    fn exact_laws_in_words() {
        let many = Law::Choice((1..=9).map(f64::from).collect());
        for (law, words) in [
            (Law::Uniform([0.5, 2.0]), "0.5 to 2"),
            (Law::Uniform([2.0, 2.0]), "2"),
            (Law::Choice(vec![3.0, 1.0]), "one of 3, 1"),
            (many, "one of 9 values from 1 to 9"),
            (Law::Weighted(vec![[0.2, 5.0], [0.8, 1.0]]), "one of 2 weighted values from 1 to 5"),
        ] {
            assert_eq!(say(&Dist::Law(law)), words);
        }
        assert_eq!(say(&Dist::Constant(0.25)), "0.25");
    }

    #[test]
    fn exact_which_sweeps_are_kept() {
        let ends = [3, 4, 11, 12, 13, 21, 22, 103, 111].map(|n| format!("{n}{}", ordinal_ending(n)));
        assert_eq!(ends, ["3rd", "4th", "11th", "12th", "13th", "21st", "22nd", "103rd", "111th"]);
        assert_eq!(kept(Keep::Every(1)), kept(Keep::All));
        assert_eq!(kept(Keep::Every(3)), "every 3rd one kept");
    }
}
