//! Contract: a plan written out is a config that gives the same plan; its hash is blind to name, scenes and card alone.

use std::path::Path;

use marsyard::config::load;
use marsyard::corpus::place::{Difference, differences};
use marsyard::plan::Plan;
use marsyard::random::{Dist, Law};
use marsyard::scene::params::GroundSource;
use marsyard::slam::SlamParams;

/// The keys in which two plans differ.
fn between(there: &Plan, here: &Plan) -> Vec<Difference> {
    differences(&there.to_yaml(), &here.to_yaml()).expect("a plan is YAML")
}

fn plan(sets: &[&str]) -> Plan {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    load(Path::new("configs/quickstart.yaml"), &sets).unwrap_or_else(|error| panic!("{}", error.lines()))
}

fn reloaded(plan: &Plan, folder: &Path) -> Plan {
    for file in &plan.files {
        let to = folder.join(&file.path);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(&file.from, to).unwrap();
    }
    let path = folder.join("plan.yaml");
    std::fs::write(&path, plan.to_yaml()).unwrap();
    load(&path, &[]).unwrap_or_else(|error| panic!("{}\n{}", error.lines(), plan.to_yaml()))
}

/// The same plan, text and hash, twice over.
fn assert_comes_back(plan: &Plan) {
    let folder = tempfile::tempdir().unwrap();
    let again = reloaded(plan, folder.path());
    assert_eq!(between(plan, &again), []);
    assert_eq!(plan.to_yaml(), again.to_yaml());
    assert!(*plan == again, "serialised alike, but not equal");
    assert_eq!(plan.scene_plan_hash(), again.scene_plan_hash());
}

#[test]
fn equal_shipped_plans_and_their_resolved_forms() {
    for entry in std::fs::read_dir("configs").unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "yaml") {
            let plan = load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.lines()));
            assert_comes_back(&plan);
        }
    }
}

#[test]
fn equal_plans_with_every_part_switched_on_and_off() {
    let variants: &[&[&str]] = &[
        &[
            "drive.instruments.sun_deg=null",
            "scene.rocks=null",
            "drive.path={straight: {length_m: 2}}",
            "drive.start={}",
        ],
        &[
            "scene.ground={source: flat, shape: {raw: {spacing_m: 0.5}}, features: [{ridge: {count: 2, height_m: 0.2, width_m: 1}}]}",
        ],
        &["scene.ground.roughness={rms_height_m: 0.01, correlation_length_m: 0.5}"],
        &["scene.rocks={golombek: {abundance: {choice: [0.02, 0.05]}}}"],
        &["scene.boxes={count: 3, length_m: 1, width_m: {normal: {mean: 1, sd: 0.5, min: 0.1, max: 2}}, height_m: 1}"],
        &["scene.trees={count: 3, diameter_m: 0.2, height_m: 2, crown: {diameter_m: 2, extinction_per_m: 2}}"],
        &["scene.vegetation={grass: {count: 3, radius_m: 1, sigma_m: 0.05}, brush: null}"],
        &["slam=truth"],
        &["slam=dead_reckoning"],
        &["slam={registration: {range_m: 8}}"],
        &["slam={surrogate: {}}"],
        &["drive.keep={every: 2}", "drive.path={waypoints: {points_m: [[3, 3], [6, 6.5]]}}"],
        &["sweep.cast={mesh: {spacing_m: 0.1}}", "sweep.mount={z_m: {uniform: [0.5, 1]}}", "sweep.sensor=os1-64"],
        &["sweep.effects={mixed_pixels: {}, dropout: {}, intensity: {}, tilt_jitter_deg: 0.1}", "sweep.sensor=rosette"],
        &[
            "cells.labels={obstacle: {taller_than_m: 0.3}, max_ground_slope_deg: 20}",
            "seed=0",
            "tables=[cells, points]",
        ],
        &[
            "drive.rover=husky-a200",
            "drive.contact=nelder_mead",
            "drive.control_noise={speed: 0.05, yaw_rate: 0.05, heading_deg_per_sqrt_m: 1}",
        ],
        &["seed=18446744073709551615", "name=on", "max_failed_share=0"],
    ];
    for sets in variants {
        assert_comes_back(&plan(sets));
    }
}

#[test]
fn law_the_scene_plan_hash_ignores_name_scenes_and_card_alone() {
    let base = plan(&[]);
    let hash = base.scene_plan_hash();
    assert_eq!(hash, plan(&["name=other", "scenes=400"]).scene_plan_hash());
    assert!(between(&base, &plan(&["name=other", "scenes=400"])).is_empty());
    let carded = plan(&["card.license=CC-BY-4.0", "card.authors=[Ann Example]"]);
    assert!(hash == carded.scene_plan_hash() && between(&base, &carded).is_empty());
    assert!(base.to_yaml() != carded.to_yaml() && base.rows_hash() == carded.rows_hash());
    for set in ["seed=43", "scenes_per_shard=20", "scene.rocks.count=5", "tables=[cells]", "slam.fastslam.particles=31"]
    {
        let other = plan(&[set]);
        assert_ne!(hash, other.scene_plan_hash(), "{set}");
        let (key, found) = (set.split('=').next().unwrap(), between(&base, &other));
        assert!(!found.is_empty() && found.iter().all(|d| d.key.starts_with(key)), "{set}: {found:?}");
    }
    // Where a family is held out, the cut into shards says which scenes it may have.
    let families = |hold_out: bool| format!("families=[{{name: a}}, {{name: b, hold_out: {hold_out}}}]");
    for (hold_out, same) in [(false, true), (true, false)] {
        let [ten, twenty] =
            [10, 20].map(|n| plan(&[&families(hold_out), &format!("scenes_per_shard={n}")]).rows_hash());
        assert_eq!(ten == twenty, same, "held out: {hold_out}");
    }
    let seed = |value: &str| Some(value.to_string());
    let expected = Difference { key: "seed".into(), there: seed("42"), here: seed("43") };
    assert_eq!(between(&base, &plan(&["seed=43"])), [expected]);
    let slam = between(&base, &plan(&["slam=truth"]));
    let expected = Difference { key: "slam".into(), there: None, here: Some("\"truth\"".into()) };
    assert!(slam.contains(&expected), "{slam:?}");
    assert!(
        slam.iter().all(|d| d.key == "slam" || d.key.starts_with("slam.fastslam.") && d.here.is_none()),
        "{slam:?}"
    );
}

#[test]
fn exact_overrides_reach_their_keys() {
    let plan = plan(&[
        "scene.rocks.count=5",
        "scene.rocks.diameter_m={uniform: [0.2, 0.4]}",
        "drive.rover.wheel_diameter_m=0.3",
    ]);
    let rocks = plan.families[0].scene.rocks.as_ref().unwrap();
    assert_eq!(rocks.count, Some(Dist::Constant(5.0)));
    assert_eq!(rocks.diameter_m, Some(Dist::Law(Law::Uniform([0.2, 0.4]))));
    assert_eq!(plan.families[0].drive.rover.wheel_diameter_m, 0.3);
    assert_eq!(plan.families[0].drive.rover.name, "kapvik");
}

/// Overrides merge key by key; another variant, another preset and null replace.
#[test]
fn exact_families_override_the_document() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("corpus.yaml");
    let text = "
marsyard: 1
name: families
seed: 0
scenes: 20
scenes_per_shard: 10
scene:
  rocks: {count: 20, diameter_m: 0.3}
  trees: {count: 3, diameter_m: 0.2, height_m: 2}
drive: {rover: kapvik, stops: 4}
sweep: {sensor: urg-04lx, effects: {range_noise: {}, dropout: {rate: 0.01}}}
slam: {fastslam: {particles: 40}}
families:
  - {name: plain, weight: 3}
  - name: other
    hold_out: true
    scene: {rocks: {count: {uniform: [1, 5]}}, trees: null}
    drive: {rover: husky-a200, stops: 6}
    sweep: {sensor: {max_range_m: 5.0}, effects: {dropout: {rate: 0.02}}}
    slam: {surrogate: {}}
  - {name: third, sweep: {sensor: vlp-16}, slam: {fastslam: {max_features: 20}}}
";
    std::fs::write(&path, text).unwrap();
    let plan = load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.lines()));
    let [plain, other, third] = plan.families.as_slice() else { panic!("three families") };
    assert_eq!((plain.weight, plain.hold_out, other.weight, other.hold_out), (3.0, false, 1.0, true));
    let rocks = other.scene.rocks.as_ref().unwrap();
    assert_eq!(
        (rocks.count.clone(), rocks.diameter_m.clone()),
        (Some(Dist::Law(Law::Uniform([1.0, 5.0]))), Some(0.3.into()))
    );
    assert!(plain.scene.trees.is_some() && other.scene.trees.is_none());
    assert_eq!((other.drive.rover.name.as_str(), other.drive.stops, plain.drive.stops), ("husky-a200", 6, 4));
    assert_eq!((other.sweep.sensor.name.as_str(), other.sweep.sensor.max_range_m), ("urg-04lx", 5.0));
    assert!(other.sweep.effects.range_noise.is_some());
    assert_eq!(other.sweep.effects.dropout.as_ref().unwrap().rate, 0.02.into());
    assert!(matches!(other.slam, SlamParams::Surrogate(_)));
    assert_eq!(third.sweep.sensor.name, "vlp-16");
    let SlamParams::Fastslam(slam) = &third.slam else { panic!("fastslam") };
    assert_eq!((slam.particles, slam.max_features), (40, 20));
    assert_comes_back(&plan);
    // Held-out families are drawn in test shards alone: shards 0 and 1 train.
    assert!((0..20).all(|scene| plan.family_of(scene).name != "other"));
}

/// An override of one family lays its key over the document's section, and leaves the rest of it.
#[test]
fn regress_overrides_of_a_family_keep_the_documents_section() {
    let path = Path::new("configs/mixed.yaml");
    let plan = |sets: &[String]| {
        let sets = [&["slam={fastslam: {particles: 100}}".to_string()], sets].concat();
        load(path, &sets).unwrap_or_else(|error| panic!("{}", error.lines()))
    };
    let (written, changed) = (
        plan(&[]),
        plan(&[
            "families.0.sweep.cast={raster: {spacing_m: 0.1}}".into(),
            "families.0.slam.fastslam.particles=5".into(),
        ]),
    );
    // A preset that the family names is written out, and changed in its place.
    let sensor = |plan: &Plan| {
        let mut sensor = serde_json::to_value(&plan.families[1].sweep.sensor).unwrap();
        (sensor["pattern"]["tilted"]["beams"].take(), sensor)
    };
    let thinned = plan(&["families.1.sweep.sensor.pattern.tilted.beams=7".into()]);
    let ((many, own), (few, other)) = (sensor(&written), sensor(&thinned));
    assert_eq!((few.as_u64(), own), (Some(7), other));
    assert!(many.as_u64() > Some(7));
    let found = between(&written, &changed);
    for key in ["families.0.sweep.cast", "families.0.slam.fastslam.particles"] {
        assert!(found.iter().any(|d| d.key.starts_with(key)), "{key}: {found:?}");
    }
    let expected =
        |d: &Difference| d.key.starts_with("families.0.sweep.cast") || d.key == "families.0.slam.fastslam.particles";
    assert!(found.iter().all(expected), "{found:?}");
}

fn npy(rows: usize, cols: usize, heights: &[f32]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {cols}), }}");
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(heights.iter().flat_map(|h| h.to_le_bytes()));
    bytes
}

fn png(side: u32, samples: &[u16]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side, side);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = samples.iter().flat_map(|s| s.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

#[test]
fn exact_height_maps_lie_as_their_files_say() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("hill.npy"), npy(2, 2, &[0.0, 1.0, 2.0, 3.0])).unwrap();
    std::fs::write(folder.path().join("hill.png"), png(2, &[0, 65_535, 13_107, 26_214])).unwrap();
    let with = |source: &str| {
        let path = folder.path().join("corpus.yaml");
        let text = std::fs::read_to_string("configs/quickstart.yaml").unwrap();
        std::fs::write(&path, text).unwrap();
        load(&path, &[format!("scene.ground.source={{file: {source}}}")])
            .unwrap_or_else(|error| panic!("{}", error.lines()))
    };
    // The file's first row is the south edge of an NPY, the north edge of a PNG.
    for (source, expected) in
        [("{path: hill.npy}", [0.0, 1.0, 2.0, 3.0]), ("{path: hill.png, height_m: 5}", [1.0, 2.0, 0.0, 5.0])]
    {
        let plan = with(source);
        let GroundSource::File(file) = &plan.families[0].scene.ground.source else { panic!("a file") };
        let raster = file.raster.as_ref().unwrap();
        assert_eq!((raster.rows, raster.cols, raster.spacing_m), (2, 2, 1.0));
        assert!(raster.heights_m.iter().zip(expected).all(|(h, e)| (h - e).abs() < 1e-12), "{:?}", raster.heights_m);
        assert_eq!(plan.files.len(), 1);
        assert_comes_back(&plan);
    }
}

#[test]
fn law_a_changed_height_map_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("corpus.yaml");
    let map = folder.path().join("hill.npy");
    std::fs::copy("configs/quickstart.yaml", &config).unwrap();
    std::fs::write(&map, npy(2, 2, &[0.0; 4])).unwrap();
    let plan = load(&config, &["scene.ground.source={file: {path: hill.npy}}".into()]).unwrap();
    reloaded(&plan, folder.path());
    std::fs::write(folder.path().join(&plan.files[0].path), npy(2, 2, &[1.0; 4])).unwrap();
    let error = load(&folder.path().join("plan.yaml"), &[]).unwrap_err();
    assert!(error.lines().contains("is another one: its BLAKE3 hash is"), "{}", error.lines());
}

#[test]
fn exact_a_pattern_file_is_written_into_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("corpus.yaml");
    std::fs::copy("configs/quickstart.yaml", &config).unwrap();
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    let csv = "# my own\nelevation_deg, azimuth_deg, time_s\n-10, 0, 0\n-20.5, 1, 0.1\n";
    std::fs::write(folder.path().join("mine/beams.csv"), csv).unwrap();
    let sensor = "name: mine\npattern: {file: {path: beams.csv}}\nmin_range_m: 0.1\nmax_range_m: 9\nrange_sigma_m: 0.01
range_step_m: 0.001\ndivergence_mrad: 1\nrange_at_10_percent_m: 4\nranging: {pulse: {pulse_ns: 5, report: first}}\n";
    std::fs::write(folder.path().join("mine/sensor.yaml"), sensor).unwrap();
    let plan =
        load(&config, &["sweep.sensor=mine/sensor.yaml".into()]).unwrap_or_else(|error| panic!("{}", error.lines()));
    let marsyard::sweep::sensor::PatternParams::File(file) = &plan.families[0].sweep.sensor.pattern else {
        panic!("a file")
    };
    assert_eq!(file.beams, [[0.0, 0.0, -10.0], [0.1, 1.0, -20.5]]);
    // The resolved plan needs neither the sensor's file nor the pattern's.
    assert_comes_back(&plan);
}

#[test]
fn exact_a_rovers_limits_stand_where_labels_read_them_and_nowhere_else() {
    // Without the rule the limits of the rover's file leave no trace: plans and hashes of old stay.
    assert!(!["limits:", "max_tilt_deg"].iter().any(|key| plan(&[]).to_yaml().contains(key)));
    let by_rover = plan(&["cells.labels={rover: {max_step_m: 0.07, soil: loose}}"]);
    assert_comes_back(&by_rover);
    let rule = by_rover.families[0].cells.labels.rover.clone().unwrap();
    assert_eq!((rule.max_step_m, rule.max_tilt_deg, rule.max_side_slip_deg), (Some(0.07), Some(30.0), Some(15.0)));
    assert!(rule.missing().is_empty() && !by_rover.to_yaml().contains("limits:"));
    assert!(plan(&["drive.rover=husky-a200", "cells.labels.rover={}"]).to_yaml().contains("max_gap_m: 0.22"));
}

#[test]
fn exact_a_rovers_rule_is_refused_where_a_limit_is_missing_or_points_are_counted_too() {
    let refused = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        load(Path::new("configs/quickstart.yaml"), &sets).expect_err("refused").lines()
    };
    let rover = "drive.rover={name: own, chassis: {rigid: {wheelbase_m: 0.4, track_m: 0.4}}, wheel_diameter_m: 0.1, length_m: 0.6, \
                 width_m: 0.5, max_speed_mps: 0.1, max_yaw_rate_degps: 10, mount: {x_m: 0, z_m: 0.5}}";
    let said = refused(&[rover, "cells.labels.rover={max_step_m: 0.1}"]);
    assert!(said.contains("of the rover 'own' says max_tilt_deg, max_gap_m, max_side_slip_deg"), "{said}");
    let said = refused(&["cells.labels={rover: {}, min_obstacle_points: 3, max_ground_slope_deg: 20}"]);
    assert!(said.contains("take it out: max_tilt_deg bounds slopes"), "{said}");
    let named = refused(&["cells.labels={rover: {max_step: 0.1}}"]);
    assert!(named.contains("max_step_m"), "{named}");
}
