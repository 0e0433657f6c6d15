//! Laws from YAML to a scene; their bits where the C library's names are not bound to the pinned functions.

use std::path::Path;

use marsyard::config::{load, load_with_remarks};
use marsyard::plan::Plan;
use marsyard::random::{Dist, Drawn, Law, Purpose, Stage, Streams};
use marsyard::scene::{Scene, Shape};

fn plan(sets: &[&str]) -> Plan {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    load(Path::new("configs/quickstart.yaml"), &sets).unwrap_or_else(|error| panic!("{}", error.lines()))
}

#[test]
fn golden_draws_of_each_law_in_the_library() {
    // The unit tests hold the same lines with the functions that the program binds under the C library's names.
    let lines = include_str!("../fixtures/law-bits.txt").lines();
    for (text, bits) in lines.filter_map(|line| line.split_once(" = ")) {
        let law: Law = serde_json::from_str(text).unwrap();
        let stream =
            Streams { seed: 7, scene: 3, attempt: 0, stage: Stage::Scene, step: 0 }.open(Purpose::RockDiameter);
        let got: Vec<String> =
            (0..3).map(|index| format!("{:016x}", Dist::Law(law.clone()).at(&stream, index).to_bits())).collect();
        assert_eq!(got.join(" "), bits, "{text}");
    }
}

/// Scenes of a plan: what was drawn for each, and its yard.
fn scenes(plan: &Plan, count: u64) -> Vec<(Drawn, Scene)> {
    let family = &plan.families[0];
    let of_scene = |scene| {
        let streams = Streams { seed: plan.seed, scene, attempt: 0, stage: Stage::Scene, step: 0 };
        let drawn = Drawn::draw(&streams, family.scene.dists());
        let yard = marsyard::scene::build(&family.scene, &drawn, &streams).unwrap();
        (drawn, yard)
    };
    (0..count).map(of_scene).collect()
}

/// Full height of a rock: its diameter, for rocks that are neither tilted nor flattened.
fn heights_m(yard: &Scene) -> impl Iterator<Item = f64> + '_ {
    yard.obstacles.iter().map(|obstacle| match &obstacle.body().shape {
        Shape::Convex(rock) => {
            let z = rock.vertices_m.iter().map(|v| v.z);
            z.clone().fold(f64::MIN, f64::max) - z.fold(f64::MAX, f64::min)
        }
        _ => panic!("a rock is a polyhedron"),
    })
}

#[test]
fn dist_rocks_of_a_yard_have_the_number_and_sizes_that_its_config_names() {
    let rocks = "scene.rocks={count: {poisson: {mean: 40}}, diameter_m: {weibull: {scale: 0.3, shape: 2, min: 0.01, max: 3}}, \
                 aspect: 1, tilt_deg: 0}";
    let scenes = scenes(&plan(&["scene.ground={source: flat}", rocks]), 200);
    let numbers: Vec<f64> = scenes.iter().map(|(drawn, _)| drawn[Purpose::RockCount]).collect();
    assert!(scenes.iter().zip(&numbers).all(|((_, yard), &number)| yard.obstacles.len() as f64 == number));
    // Five standard errors of 200 Poisson numbers, and of some 8000 Weibull draws: mean scale Gamma(1.5), sd 0.463 scale; cutting 0.1 %
    // from below moves the mean by less than 0.0003 m.
    let mean = numbers.iter().sum::<f64>() / 200.0;
    assert!((mean - 40.0).abs() < 5.0 * (40.0f64 / 200.0).sqrt(), "{mean}");
    let heights_m: Vec<f64> = scenes.iter().flat_map(|(_, yard)| heights_m(yard)).collect();
    let count = heights_m.len() as f64;
    let mean_m = heights_m.iter().sum::<f64>() / count;
    assert!((mean_m - 0.3 * 0.886_227).abs() < 5.0 * 0.3 * 0.463 / count.sqrt() + 0.0003, "{mean_m}");
}

#[test]
fn law_another_law_of_a_key_moves_no_other_value() {
    let rocks = |law: &str| format!("scene.rocks={{count: 30, diameter_m: {law}, aspect: 1, tilt_deg: 0}}");
    let [gamma, narrow, beta] = [
        "{gamma: {shape: 2, scale: 0.1, min: 0.05, max: 2}}",
        "{gamma: {shape: 2, scale: 0.1, min: 0.2, max: 0.21}}",
        "{beta: {alpha: 2, beta: 5, low: 0.1, high: 0.8}}",
    ]
    .map(|law| scenes(&plan(&[&rocks(law)]), 5));
    for ((a, b), c) in gamma.iter().zip(&narrow).zip(&beta) {
        assert_eq!(a.0, b.0);
        assert_eq!(a.0, c.0);
        let seats = |yard: &Scene| yard.obstacles.iter().map(|rock| rock.middle_m).collect::<Vec<_>>();
        assert_eq!(seats(&a.1), seats(&b.1));
        assert_eq!(seats(&a.1), seats(&c.1));
        assert!(heights_m(&a.1).zip(heights_m(&c.1)).all(|(a, c)| a != c));
    }
}

#[test]
fn equal_laws_written_out_and_read_again() {
    let text = include_str!("../fixtures/law-bits.txt").lines().filter_map(|line| line.split_once(" = "));
    for (law, _) in text {
        let key = if law.contains("poisson") { "count" } else { "diameter_m" };
        // No rock is smaller than a millimetre.
        let law = law.replace("\"min\":0,", "\"min\":0.01,");
        let plan = plan(&[&format!("scene.rocks.{key}={law}")]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.yaml");
        std::fs::write(&path, plan.to_yaml()).unwrap();
        let again = load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.lines()));
        assert!(plan == again, "{law}");
    }
}

#[test]
fn exact_a_law_of_a_family_replaces_that_of_the_document() {
    let sets = [
        "scene.rocks.diameter_m={gamma: {shape: 2, scale: 0.1, min: 0.05, max: 2}}",
        "families=[{name: a}, {name: b, scene: {rocks: {diameter_m: {pert: {low: 0.1, mode: 0.2, high: 1}}}}}]",
    ];
    let plan = plan(&sets);
    let law = |family: usize| plan.families[family].scene.rocks.as_ref().unwrap().diameter_m.clone().unwrap();
    assert_eq!(law(0), Dist::Law(Law::Gamma { shape: 2.0, scale: 0.1, min: 0.05, max: 2.0 }));
    assert_eq!(law(1), Dist::Law(Law::Pert { low: 0.1, mode: 0.2, high: 1.0, shape: 4.0 }));
}

#[test]
fn extreme_a_thousand_families_are_held_and_no_more() {
    let families = |count: usize| {
        let entries: Vec<String> = (0..count).map(|k| format!("{{name: f{k}}}")).collect();
        load(Path::new("configs/quickstart.yaml"), &[format!("families=[{}]", entries.join(", "))])
    };
    assert_eq!(families(1000).unwrap().families.len(), 1000);
    let lines = families(1001).unwrap_err().lines();
    assert_eq!(
        lines,
        "--set:1:10: 'families' may have at most 1000 entries, got 1001; let a law vary what the families differ in, or make several corpora\n"
    );
}

#[test]
fn exact_what_is_legal_and_hardly_meant_is_remarked() {
    let remarks = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        load_with_remarks(Path::new("configs/quickstart.yaml"), &sets)
            .unwrap_or_else(|error| panic!("{}", error.lines()))
            .1
    };
    assert_eq!(remarks(&[]), [""; 0]);
    // A window of sweeps around the one that is kept is what `window_scans` is for.
    assert_eq!(remarks(&["cells.window_scans=2", "drive.keep=last"]), [""; 0]);
    assert_eq!(
        remarks(&["cells.max_range_m=40"]),
        ["--set:1:19: cells reach to 40 m, but 'urg-04lx' reports nothing beyond 5.6 m; \
          take cells.max_range_m out for the sensor's own reach, or give a smaller one"]
    );
    let rover = "drive.rover={name: long, chassis: {rigid: {wheelbase_m: 3.0, track_m: 0.4}}, wheel_diameter_m: 0.1, length_m: 0.45, \
                 width_m: 0.5, max_speed_mps: 0.1, max_yaw_rate_degps: 10, mount: {x_m: 0, z_m: 0.5}}";
    let said = remarks(&[rover]);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(
        said[0].contains("the wheels of 'long' stand 3 m apart, outside its outline (length_m 0.45 m)"),
        "{said:?}"
    );
    assert!(said[0].ends_with("give length_m the whole rover, wheels included"), "{said:?}");
    let slip = "drive.instruments.slip=0.1";
    assert_eq!(remarks(&[slip]), [""; 0]);
    let twice = [slip, "slam={fastslam: {motion_inflation: 6}}"];
    assert_eq!(
        remarks(&twice),
        ["--set:1:36: the filter learns the wheels' slip, and motion_inflation 6 allows for it again; \
          take slam.fastslam.motion_inflation out, unless the wheels err by more than drive.instruments says"]
    );
    assert_eq!(remarks(&twice[1..]), [""; 0]);
    assert_eq!(remarks(&["drive.instruments.slip=0", twice[1]]), [""; 0]);
    assert_eq!(remarks(&["cells.overhang={}"]), [""; 0]);
    let said = remarks(&["cells.overhang={above_m: 0.3}"]);
    assert!(
        said[0].contains("a rover fits beneath what hangs 0.3 m high, but the mast of 'kapvik' is 0.4 m; take"),
        "{said:?}"
    );
}

#[test]
fn law_wheels_that_no_column_tells_are_remarked() {
    let remarks = |config: &str, sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        load_with_remarks(Path::new(config), &sets).unwrap_or_else(|error| panic!("{}", error.lines())).1
    };
    assert_eq!(remarks("scripts/broad.yaml", &[]), [""; 0]);
    let said = remarks("configs/mixed.yaml", &[]);
    assert_eq!(said.len(), 1, "{said:?}");
    let told = "labels go by the wheels of 3 rovers (0.1, 0.222, 0.3302 m), and no column tells a network which: what stands between 0.1 and 0.3302 m";
    assert!(said[0].starts_with("configs/mixed.yaml:") && said[0].contains(told), "{said:?}");
    assert!(said[0].ends_with("train --labels taller_than_wheel=DIAMETER_M,max_ground_slope_deg=45"), "{said:?}");
    // One height for all is another matter, and so is a family that is only judged by, or that no scene is drawn from.
    assert_eq!(remarks("configs/mixed.yaml", &["cells.labels.obstacle={taller_than_m: 0.2}"]), [""; 0]);
    let families = |other: &str| {
        let other = format!("{{name: b, {other}, drive: {{rover: husky-a200}}}}");
        remarks("configs/quickstart.yaml", &[&format!("families=[{{name: a, weight: 1}}, {other}]")]).len()
    };
    let others = ["weight: 1", "weight: 1, hold_out: true", "weight: 0", "weight: 0, hold_out: true"];
    assert_eq!(others.map(families), [1, 0, 0, 0]);
}

#[test]
fn law_rules_of_labels_that_no_column_tells_are_remarked_with_what_trains_by_one() {
    let told = |ours: &str, theirs: &str| {
        let of = |name: &str, labels: &str| format!("{{name: {name}, weight: 1, cells: {{labels: {{{labels}}}}}}}");
        let sets = [format!("families=[{}, {}]", of("a", ours), of("b", theirs))];
        let remarks = load_with_remarks(Path::new("configs/quickstart.yaml"), &sets);
        let remarks = remarks.unwrap_or_else(|error| panic!("{}", error.lines())).1;
        assert!(remarks.len() <= 1, "{remarks:?}");
        remarks.into_iter().next().unwrap_or_default()
    };
    let wheel = "obstacle: taller_than_wheel";
    for [ours, theirs, rule, cure] in [
        [wheel, wheel, "", ""],
        ["obstacle: all, max_drop_m: 0.2", "obstacle: all, max_drop_m: 0.2", "", ""],
        [
            "obstacle: {taller_than_m: 0.3}, max_ground_slope_deg: 30, max_drop_m: 0.2",
            "obstacle: {taller_than_m: 0.2}, max_ground_slope_deg: 30, max_drop_m: 0.2",
            "labels go by 2 heights of obstacles (0.2, 0.3 m), and no column tells a network which: what stands between 0.2 and 0.3 m tall is",
            "marsyard train --labels taller_than_wheel=DIAMETER_M,max_ground_slope_deg=30,max_drop_m=0.2",
        ],
        [
            "obstacle: {taller_than_m: 0.2}, max_ground_slope_deg: 30",
            "obstacle: {taller_than_m: 0.2}, max_ground_slope_deg: 20",
            "labels go by unlike slopes of the ground (20, 30 degrees), and no column tells a network which: what looks the same is",
            "train by one: marsyard train --labels taller_than_m=0.2,max_ground_slope_deg=DEGREES",
        ],
        [
            "obstacle: all, max_drop_m: 0.2",
            "obstacle: all, max_drop_m: 0.25",
            "labels go by unlike drops (0.2, 0.25 m), and no column",
            "marsyard train --labels all,max_drop_m=METRES",
        ],
        [
            "obstacle: all, min_obstacle_points: 2",
            "obstacle: all",
            "labels go by unlike counts of points (1, 2), and no column",
            "train --labels counts no points",
        ],
        [
            "rover: {max_step_m: 0.05}",
            "rover: {max_step_m: 0.1}",
            "labels go by what a rover can cross (cells.labels.rover), not by the same rover and rule in all families, and no column",
            "or build a corpus for each rover",
        ],
    ] {
        let said = told(ours, theirs);
        assert_eq!(said.is_empty(), rule.is_empty(), "{ours} | {theirs}: {said}");
        assert!(said.contains(rule) && said.ends_with(cure), "{ours} | {theirs}: {said}");
    }
}

#[test]
fn exact_a_plan_holds_the_free_height_that_its_rover_needs_and_other_plans_stay_as_they_were() {
    let above_m =
        |sets: &[&str]| plan(sets).families[0].cells.overhang.map(|overhang| overhang.above_m.expect("resolved"));
    assert_eq!(above_m(&[]), None);
    let near = |sets: &[&str], expected_m: f64| {
        let got_m = above_m(sets).expect("a rule");
        assert!((got_m - expected_m).abs() < 1e-9, "{sets:?}: {got_m}");
    };
    near(&["cells.overhang={}"], 0.6);
    near(&["cells.overhang={}", "drive.rover=husky-a200"], 0.8);
    near(&["cells.overhang={}", "sweep.mount={z_m: {uniform: [0.2, 1.5]}}"], 1.7);
    near(&["cells.overhang={above_m: 1.1}"], 1.1);
    // Its height stands in the rule and nowhere else.
    for sets in [&[][..], &["cells.overhang={}"]] {
        assert_eq!(plan(sets).families[0].drive.rover.height_m, None);
    }
}
