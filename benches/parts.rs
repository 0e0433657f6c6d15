//! What each part of a scene costs: an empty yard, then each part added alone. A table on stdout (Markdown).
//!
//! `cargo bench --bench parts [-- ROUNDS]`. One thread; each round takes one scene number and runs it under every setting, in an order
//! that turns by one; CPU time; median over the rounds of the difference from the setting that the part is added to (same
//! scene, same draws), with the quartiles. One scan a scene, so a scene's cost is a scan's.

use std::path::Path;

use marsyard::config;
use marsyard::corpus::{CorpusSpec, ShardWriter, Table};
use marsyard::episode::SceneOutput;
use marsyard::episode::{Prepared, Scratch, StageTimes, Unobserved, run_scene};
use marsyard::measure::clock::thread_cpu_s;
use marsyard::measure::estimate::scene_costs;
use marsyard::measure::interleave::{Repeats, rotated};
use marsyard::statistics::Spread;

/// A yard that parts are added to, by its place in `YARDS`.
const EMPTY: usize = 0;
const ROCKS: usize = 1;
const VAST: usize = 2;

/// (name, what is set beyond the empty yard, the yard that its cost is counted from)
const YARDS: [(&str, &[&str], usize); 3] = [
    ("empty yard", &[], EMPTY),
    ("20 rocks", &["scene.rocks={count: 20, diameter_m: {log_uniform: [0.1, 1]}}"], EMPTY),
    // So wide that in a few hundred scenes hardly one of 2000 rocks comes into reach of the sensor.
    ("a yard of 10 km", &["scene.extent_m=10000", "scene.ground.source.random.correlation_length_m=4000"], EMPTY),
];

const PARTS: [(&str, &[&str], usize); 26] = [
    ("2000 rocks out of reach", &["scene.rocks={count: 2000, diameter_m: {log_uniform: [0.1, 1]}}"], VAST),
    ("5 boxes", &["scene.boxes={count: 5, length_m: 0.6, width_m: 0.4, height_m: 0.4}"], EMPTY),
    ("5 trees", &["scene.trees={count: 5, diameter_m: 0.2, height_m: 3}"], EMPTY),
    (
        "5 trees with crowns",
        &["scene.trees={count: 5, diameter_m: 0.2, height_m: 3, crown: {diameter_m: 2, extinction_per_m: 4}}"],
        EMPTY,
    ),
    ("5 patches of grass", &["scene.vegetation={grass: {count: 5, radius_m: 1.5, sigma_m: 0.05}}"], EMPTY),
    ("5 patches of brush", &["scene.vegetation={brush: {count: 5, radius_m: 1, sigma_m: 0.2}}"], EMPTY),
    ("5 bushes", &["scene.vegetation={bushes: {count: 5, diameter_m: 1, height_m: 0.8, extinction_per_m: 4}}"], EMPTY),
    ("roughness", &["scene.ground.roughness={rms_height_m: 0.01, correlation_length_m: 0.5}"], EMPTY),
    ("a crater", &["scene.ground.features=[{crater: {count: 1, height_m: 0.3, width_m: 4}}]"], EMPTY),
    ("raw ground at 0.1 m", &["scene.ground.shape={raw: {spacing_m: 0.1}}"], EMPTY),
    ("control noise", &["drive.control_noise={speed: 0.05, yaw_rate: 0.05, heading_deg_per_sqrt_m: 1}"], EMPTY),
    ("contact by Nelder-Mead", &["drive.contact=nelder_mead"], EMPTY),
    ("range_noise", &["sweep.effects.range_noise={}"], EMPTY),
    ("range_noise with incidence", &["sweep.effects.range_noise={incidence: true}"], EMPTY),
    ("range_bias", &["sweep.effects.range_bias_m=0.01"], EMPTY),
    ("quantisation", &["sweep.effects.quantisation={}"], EMPTY),
    ("gates", &["sweep.effects.gates={}"], EMPTY),
    ("tilt_jitter", &["sweep.effects.tilt_jitter_deg=0.02"], EMPTY),
    ("dropout", &["sweep.effects.dropout={rate: 0.01}"], EMPTY),
    ("mixed_pixels, 7 sub-rays", &["sweep.effects.mixed_pixels={sub_rays: 7}"], EMPTY),
    ("intensity", &["sweep.effects.intensity={}"], EMPTY),
    ("surrogate poses", &["slam={surrogate: {}}"], EMPTY),
    ("dead reckoning", &["slam=dead_reckoning"], EMPTY),
    ("FastSLAM, 100 particles, among 20 rocks", &["slam={fastslam: {particles: 100}}"], ROCKS),
    ("local_height", &["cells.local_height={}"], EMPTY),
    ("24 neighbours", &["cells.neighbours=24"], EMPTY),
];

fn prepared(sets: &[&str]) -> Prepared {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/empty_yard.yaml");
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_string()).collect();
    let plan = config::load(&file, &sets).unwrap_or_else(|error| panic!("{sets:?}: {:?}", miette::Report::new(error)));
    Prepared::new(plan).expect("a sensor of the library")
}

fn main() {
    let rounds: usize = std::env::args().skip(1).find_map(|argument| argument.parse().ok()).unwrap_or(41);
    let all: Vec<_> = YARDS.into_iter().chain(PARTS).collect();
    // A part stands on its yard.
    let sets_of = |k: usize| {
        let (_, sets, base) = all[k];
        let yard: &[&str] = if k < YARDS.len() { &[] } else { YARDS[base].1 };
        [yard, sets].concat()
    };
    let plans: Vec<Prepared> = (0..all.len()).map(|k| prepared(&sets_of(k))).collect();
    let mut scratch = Scratch::default();
    scene_costs(&plans, 0, 0, &mut scratch);
    let sweep = StageTimes::STAGES.iter().position(|(_, name)| *name == "sweep").expect("a stage");
    let (mut whole_s, mut sweep_s) = (Repeats::default(), Repeats::default());
    for round in 0..rounds {
        let costs = scene_costs(&plans, 1 + round as u64, round, &mut scratch);
        whole_s.push(costs.iter().map(|costs| costs.whole.cpu).collect());
        sweep_s.push(costs.iter().map(|costs| costs.stages[sweep].cpu).collect());
    }

    println!("# What each part costs\n");
    println!(
        "`cargo bench --bench parts -- {rounds}`: CPU ms a scan on one thread, medians of {rounds} scenes, quartiles in brackets."
    );
    println!(
        "The empty yard: a fitted ground of 20 m, one sweep of 68,200 beams (URG-04LX), true pose, cells to 4 m.\n"
    );
    println!("| part, added alone | ms a scan | quartiles | of what it is added to | added to |");
    println!("|---|--:|---|--:|---|");
    let whole = |k: usize| whole_s.spread(k).expect("a round");
    println!("| empty yard | {} | | |", median_and_quartiles(&whole(EMPTY)));
    for (k, (name, _, base)) in all.iter().enumerate().skip(1) {
        let added_s = whole_s.spread_of_difference(k, *base).expect("a round");
        let share = 100.0 * added_s.median / whole(*base).median;
        println!("| {name} | {} | {share:+.1} % | {} |", median_and_quartiles(&added_s), YARDS[*base].0);
    }
    tables(rounds, &mut scratch);

    let far = YARDS.len();
    let added_s = |seconds: &Repeats| seconds.spread_of_difference(far, VAST).expect("a round").median;
    let (added_s, in_sweep_s) = (added_s(&whole_s), added_s(&sweep_s));
    let sweep_s = sweep_s.spread(VAST).expect("a round").median;
    println!(
        "\nOut of reach: 2000 rocks that no beam can meet cost {:.1} us in all, {:.2} % of the sweep ({:.3} ms); {:.1} us of it ({:.2} %) \
         in the sweep's own stage.",
        1e6 * added_s,
        100.0 * added_s / sweep_s,
        1e3 * sweep_s,
        1e6 * in_sweep_s,
        100.0 * in_sweep_s / sweep_s
    );
}

/// Two fields of a table's row, in milliseconds.
fn median_and_quartiles(seconds: &Spread) -> String {
    let Spread { median, lower_quartile, upper_quartile } = seconds;
    format!("{:.3} | [{:.3}, {:.3}]", 1e3 * median, 1e3 * lower_quartile, 1e3 * upper_quartile)
}

/// Each table of a shard of 20 scenes, made alone.
fn tables(rounds: usize, scratch: &mut Scratch) {
    const SCENES: u32 = 20;
    let set = format!("scenes_per_shard={SCENES}");
    let plan = prepared(&["tables=[cells, scenes, poses, points]", &set]);
    let outputs: Vec<SceneOutput> =
        (0..u64::from(SCENES)).map(|scene| run_scene(&plan, scene, scratch, &mut Unobserved)).collect();
    let spec = plan.plan.corpus_spec();
    let made_s = |table: Table| {
        let spec = CorpusSpec { tables: vec![table], ..spec.clone() };
        let begun_s = thread_cpu_s();
        let mut writer = ShardWriter::new(&spec, 0).expect("a plan's tables");
        outputs.iter().for_each(|output| writer.push(output).expect("rows of this plan"));
        std::hint::black_box(writer.finish().expect("all scenes were pushed"));
        (thread_cpu_s() - begun_s) / f64::from(SCENES)
    };
    let mut seconds = Repeats::default();
    for round in 0..rounds.div_ceil(4) {
        seconds.push(rotated(Table::ALL.len(), round, |k| made_s(Table::ALL[k])));
    }
    for (k, table) in Table::ALL.into_iter().enumerate() {
        let made_s = seconds.spread(k).expect("a round");
        println!(
            "| writing the {} table | {} | | shards of {SCENES} scenes |",
            table.name(),
            median_and_quartiles(&made_s)
        );
    }
}
