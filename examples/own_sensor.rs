//! A sensor of one's own in the yards of a shipped config: a cone of beams on a golden spiral, beside the sensor of the paper.
//!
//! `cargo run --release --example own_sensor`. A sensor is data; what is not a shipped pattern is a list of beams, as from a CSV file of
//! time, azimuth and elevation. The table tells which share of the cells in a ring about the sensor each of the two sees.

use std::error::Error;
use std::f64::consts::PI;
use std::path::Path;

use marsyard::math;
use marsyard::preset::Preset;
use marsyard::sweep::sensor::{Echo, PatternFile, PatternParams, PulseRanging, Ranging, Sensor};
use marsyard::{config, episode::Prepared, simulate_scene};

const SCENE: u64 = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.yaml");
    let shipped = config::load(&config, &[])?;
    let mut own = shipped.clone();
    own.families[0].sweep.sensor = Preset::Inline(Box::new(spiral(40_000)));

    println!("{:>9} {:>9} {:>9}   share of a ring's cells seen, scene {SCENE}", "ring", "shipped", "own");
    let [shipped, own] = [shipped, own].map(|plan| rings(&Prepared::new(plan)?));
    for (k, (shipped, own)) in shipped?.iter().zip(own?).enumerate() {
        println!("{k:>3} to {} m {:>8.1} % {:>7.1} %", k + 1, 100.0 * shipped, 100.0 * own);
    }
    Ok(())
}

/// A pulsed sensor whose beams cover a cone, 50 degrees down to 5 up and 60 to each side, evenly.
fn spiral(beams: u32) -> Sensor {
    let turn_deg = 180.0 * (3.0 - 5.0_f64.sqrt());
    let (low, high) = (math::sin((-50.0_f64).to_radians()), math::sin(5.0_f64.to_radians()));
    let beam = |k: u32| {
        let share = (f64::from(k) + 0.5) / f64::from(beams);
        let azimuth_deg = (f64::from(k) * turn_deg).rem_euclid(120.0) - 60.0;
        [share, azimuth_deg, math::asin(low + share * (high - low)).to_degrees()]
    };
    Sensor {
        name: "golden-spiral".into(),
        source: "made up".into(),
        pattern: PatternParams::File(PatternFile { path: "spiral.csv".into(), beams: (0..beams).map(beam).collect() }),
        min_range_m: 0.1,
        max_range_m: 20.0,
        range_sigma_m: 0.02,
        range_sigma_per_m: 0.0,
        range_bias_m: 0.0,
        range_step_m: 0.002,
        divergence_mrad: 3.0,
        exit_diameter_m: 0.0,
        range_at_10_percent_m: 15.0,
        ranging: Ranging::Pulse(PulseRanging { pulse_ns: 5.0, report: Echo::Strongest }),
    }
}

/// Of the cells in rings of 1 m about the sensor, the share that holds a point.
fn rings(prepared: &Prepared) -> Result<[f64; 4], Box<dyn Error>> {
    let scene = simulate_scene(prepared, SCENE)?;
    let size_m = prepared.plan.families[0].cells.size_m;
    let mut seen = [0.0; 4];
    for cell in &scene.scans[0].cells.rows {
        if let Some(ring) = seen.get_mut(cell.range_m as usize) {
            *ring += 1.0;
        }
    }
    let cells_in = |k: usize| PI * (((k + 1) * (k + 1) - k * k) as f64) / (size_m * size_m);
    Ok(std::array::from_fn(|k| seen[k] / cells_in(k)))
}
