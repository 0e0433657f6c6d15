//! The whole pipeline: CPU by stage, rates, and what it costs over casting alone. One thread, CPU time; nothing is put on disk.
//!
//! `cargo bench --bench pipeline [-- SCENES]`
//!
//! Scene by scene, so that both sides see the same load of the machine: the scene is run and written to a shard's bytes; then all its
//! sweeps are cast again, alone, from the drive's true poses (set-up of each sensor position included). Where a scene was driven
//! more than once, casting alone is scaled to the rays that were cast.

mod shared;

use marsyard::corpus::ShardWriter;
use marsyard::episode::{Prepared, Scratch, StageTimes, Unobserved, replay_scene, run_scene};
use marsyard::geometry::DVec3;
use marsyard::measure::clock::{Costs, thread_cpu_s};
use marsyard::sweep::Caster;
use shared::paper::prepared;

/// CPU seconds and counts, summed over scenes.
#[derive(Default)]
struct Sums {
    stages_s: [f64; StageTimes::STAGES.len()],
    writing_s: f64,
    casting_s: f64,
    rays: u64,
    rows: usize,
    sweeps: usize,
}

fn main() {
    let scenes = std::env::args().skip(1).find_map(|word| word.parse().ok()).unwrap_or(40u32);
    let size = [format!("scenes={scenes}"), format!("scenes_per_shard={scenes}")];
    let keep_ten = ["drive.stops=10", "drive.keep=all"];
    for (what, sets) in [
        ("paper.yaml", &[][..]),
        ("paper.yaml, ten kept sweeps a yard", &keep_ten[..]),
        ("the same, true poses: no slam", &["drive.stops=10", "drive.keep=all", "slam=truth"][..]),
        ("paper.yaml, the paper's own contact solver: nelder_mead", &["drive.contact=nelder_mead"][..]),
    ] {
        let sets: Vec<&str> = sets.iter().copied().chain(size.iter().map(String::as_str)).collect();
        tell(what, &measure(&prepared("paper.yaml", &sets), scenes));
    }
}

fn measure(prepared: &Prepared, scenes: u32) -> Sums {
    let spec = prepared.plan.corpus_spec();
    let mut writer = ShardWriter::new(&spec, 0).expect("a schema");
    let (mut scratch, mut sums) = (Scratch::default(), Sums::default());
    // Once without counting: memory is at hand afterwards.
    run_scene(prepared, 0, &mut scratch, &mut Unobserved);
    for scene in 0..u64::from(scenes) {
        let mut costs = Costs::start();
        let output = run_scene(prepared, scene, &mut scratch, &mut costs);
        let costs = costs.finish();
        let begun = thread_cpu_s();
        writer.push(&output).expect("good rows");
        sums.writing_s += thread_cpu_s() - begun;
        for (sum, stage) in sums.stages_s.iter_mut().zip(&costs.stages) {
            *sum += stage.cpu;
        }
        sums.rays += costs.rays;
        sums.rows += output.scans.iter().map(|scan| scan.cells.rows.len()).sum::<usize>();
        sums.sweeps += costs.rays as usize / prepared.pattern(0).directions.len();
        sums.casting_s += casting_alone_s(prepared, scene, &mut scratch, costs.rays);
    }
    let begun = thread_cpu_s();
    writer.finish().expect("a whole shard");
    sums.writing_s += thread_cpu_s() - begun;
    sums
}

/// CPU seconds of casting a scene's rays and nothing else.
fn casting_alone_s(prepared: &Prepared, scene: u64, scratch: &mut Scratch, rays: u64) -> f64 {
    let Ok(replay) = replay_scene(prepared, scene, scratch, &mut Unobserved) else { return 0.0 };
    let family = &prepared.plan.families[replay.family];
    let directions = &prepared.pattern(replay.family).directions;
    let caster = Caster::new(&replay.scene, &family.sweep.cast);
    let (mut hits, mut spent_s) = (Vec::new(), 0.0);
    for &stop in &replay.drive.stops {
        let world_from_sensor = replay.drive.truth[stop].transform() * replay.rover_from_sensor;
        let turned: Vec<DVec3> = directions.iter().map(|d| world_from_sensor.direction(*d)).collect();
        let begun = thread_cpu_s();
        caster.from(world_from_sensor.translation_m, family.sweep.sensor.max_range_m).cast(&turned, &mut hits);
        spent_s += thread_cpu_s() - begun;
    }
    spent_s * rays as f64 / (replay.drive.stops.len() * directions.len()) as f64
}

fn tell(what: &str, sums: &Sums) {
    let sweeps = sums.sweeps as f64;
    let whole_s = sums.stages_s.iter().sum::<f64>() + sums.writing_s;
    println!("{what}: {} sweeps cast, {} rows; milliseconds of CPU a sweep cast", sums.sweeps, sums.rows);
    for ((_, name), seconds) in StageTimes::STAGES.iter().zip(&sums.stages_s) {
        println!("  {name:14} {:8.3}", 1e3 * seconds / sweeps);
    }
    println!(
        "  {:14} {:8.3}   {:.1} % of the whole",
        "writing",
        1e3 * sums.writing_s / sweeps,
        1e2 * sums.writing_s / whole_s
    );
    println!("  {:14} {:8.3}   {:.3e} rows/s", "whole", 1e3 * whole_s / sweeps, sums.rows as f64 / whole_s);
    println!(
        "  {:14} {:8.3}   {:.3e} rays/s",
        "casting alone",
        1e3 * sums.casting_s / sweeps,
        sums.rays as f64 / sums.casting_s
    );
    let swept_s = sums.stages_s[2];
    println!(
        "  whole over casting alone {:.2}; over the sweep stage {:.2}",
        whole_s / sums.casting_s,
        whole_s / swept_s
    );
}
