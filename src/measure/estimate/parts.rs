//! A family and each part that it switches on -> what that part costs.
//!
//! The same scenes (same addresses, so the same draws) with the part and without it, in turn, on one thread each: CPU time,
//! mean of the differences. What a part costs elsewhere is in its price: rocks bring features that FastSLAM must match, FastSLAM
//! reads sweeps that nobody keeps. So prices need not add up to the whole. A scene is measured at one attempt; further attempts
//! are a part of their own, for whether an attempt is repeated must not decide what dropout costs. The time of writing is not
//! in it but for tables, which `encode` measures.

use std::sync::Mutex;
use std::time::Instant;

use super::sample::Sample;
use super::{EstimateError, FamilyCost, Options};
use crate::corpus::Table;
use crate::episode::{Prepared, Scratch, run_scene};
use crate::measure::clock::Costs;
use crate::plan::Plan;
use crate::slam::SlamParams;

/// A standard error of a price, relative to the whole scene, at which measuring ends.
const ENOUGH: f64 = 0.003;
/// Rounds before a standard error means anything.
const FIRST: usize = 4;

/// Something that a config may name and may leave out.
#[derive(Debug)]
pub struct Part {
    pub name: &'static str,
    /// Whether the plan's family switches it on.
    pub is_on: fn(&Plan, usize) -> bool,
    /// Takes it out of the family.
    leave_out: fn(&mut Plan, usize),
}

/// CPU seconds a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartCost {
    pub cpu_s: f64,
    pub standard_error_s: f64,
}

impl PartCost {
    /// More than twice its standard error from nothing.
    pub fn is_told_apart(&self) -> bool {
        self.cpu_s.abs() > 2.0 * self.standard_error_s
    }
}

/// A part that is an optional key.
macro_rules! key {
    ($name:literal, $($path:ident).+) => {
        Part {
            name: $name,
            is_on: |plan, family| plan.families[family].$($path).+.is_some(),
            leave_out: |plan, family| plan.families[family].$($path).+ = None,
        }
    };
}

/// A part that is an optional key of the vegetation.
macro_rules! plants {
    ($name:literal, $key:ident) => {
        Part {
            name: $name,
            is_on: |plan, family| plan.families[family].scene.vegetation.as_ref().is_some_and(|v| v.$key.is_some()),
            leave_out: |plan, family| {
                if let Some(vegetation) = &mut plan.families[family].scene.vegetation {
                    vegetation.$key = None;
                }
            },
        }
    };
}

/// All parts, in the order of the flow.
pub static PARTS: [Part; 23] = [
    key!("roughness", scene.ground.roughness),
    Part {
        name: "landforms",
        is_on: |plan, family| !plan.families[family].scene.ground.features.is_empty(),
        leave_out: |plan, family| plan.families[family].scene.ground.features.clear(),
    },
    key!("rocks", scene.rocks),
    key!("boxes", scene.boxes),
    key!("trees", scene.trees),
    plants!("grass", grass),
    plants!("brush", brush),
    plants!("bushes", bushes),
    key!("control_noise", drive.control_noise),
    Part {
        name: "attempts",
        is_on: |plan, family| plan.families[family].drive.attempts > 1,
        leave_out: |plan, family| plan.families[family].drive.attempts = 1,
    },
    key!("range_noise", sweep.effects.range_noise),
    key!("range_bias", sweep.effects.range_bias_m),
    key!("quantisation", sweep.effects.quantisation),
    key!("gates", sweep.effects.gates),
    key!("dropout", sweep.effects.dropout),
    key!("mixed_pixels", sweep.effects.mixed_pixels),
    key!("tilt_jitter", sweep.effects.tilt_jitter_deg),
    key!("intensity", sweep.effects.intensity),
    Part {
        name: "fastslam",
        is_on: |plan, family| matches!(plan.families[family].slam, SlamParams::Fastslam(_)),
        leave_out: |plan, family| plan.families[family].slam = SlamParams::Truth,
    },
    Part {
        name: "dead_reckoning",
        is_on: |plan, family| plan.families[family].slam == SlamParams::DeadReckoning,
        leave_out: |plan, family| plan.families[family].slam = SlamParams::Truth,
    },
    Part {
        name: "window_scans",
        is_on: |plan, family| plan.families[family].cells.window_scans > 1,
        leave_out: |plan, family| plan.families[family].cells.window_scans = 1,
    },
    key!("local_height", cells.local_height),
    Part {
        name: "points table",
        is_on: |plan, _| plan.tables.contains(&Table::Points),
        leave_out: |plan, _| plan.tables.retain(|table| *table != Table::Points),
    },
];

/// What one scene takes under each plan, one after the other; which comes first turns with `turn`.
pub fn interleaved(prepared: &[Prepared], scene: u64, turn: usize, scratch: &mut Scratch) -> Vec<Costs> {
    let mut taken = vec![Costs::start(); prepared.len()];
    for k in (0..prepared.len()).map(|k| (k + turn) % prepared.len()) {
        let mut costs = Costs::start();
        std::hint::black_box(run_scene(&prepared[k], scene, scratch, &mut costs));
        taken[k] = costs.finish();
    }
    taken
}

/// One family: the plan at one attempt, then without each part.
struct Pairs {
    prepared: Vec<Prepared>,
    parts: Vec<&'static Part>,
    order: Vec<u64>,
    begun: usize,
    /// Seconds of each scene under each plan.
    taken_s: Vec<Vec<f64>>,
}

impl Pairs {
    fn new(plan: &Plan, family: usize, order: &[u64]) -> Result<Pairs, EstimateError> {
        let parts: Vec<&'static Part> = PARTS.iter().filter(|part| (part.is_on)(plan, family)).collect();
        let mut once = plan.clone();
        once.families[family].drive.attempts = 1;
        let without = |part: &&Part| {
            // Further attempts are what the plan has and the measured scene has not.
            let mut other = if part.name == "attempts" { plan.clone() } else { once.clone() };
            if part.name != "attempts" {
                (part.leave_out)(&mut other, family);
            }
            Prepared::new(other)
        };
        let whole = std::iter::once(Prepared::new(once.clone()));
        let prepared = whole.chain(parts.iter().map(without)).collect::<Result<_, _>>()?;
        Ok(Pairs { prepared, parts, order: order.to_vec(), begun: 0, taken_s: Vec::new() })
    }

    /// The price of part `k`.
    fn price(&self, k: usize) -> PartCost {
        let sign = if self.parts[k].name == "attempts" { -1.0 } else { 1.0 };
        let differences: Vec<f64> = self.taken_s.iter().map(|s| sign * (s[0] - s[k + 1])).collect();
        mean_with_error(&differences)
    }

    fn is_known(&self) -> bool {
        let whole_s = self.taken_s.iter().map(|s| s[0]).sum::<f64>() / self.taken_s.len().max(1) as f64;
        self.begun >= self.order.len()
            || self.taken_s.len() >= FIRST
                && (0..self.parts.len()).all(|k| self.price(k).standard_error_s < ENOUGH * whole_s)
    }
}

fn mean_with_error(values: &[f64]) -> PartCost {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    let standard_error_s = if count > 1.0 { (squares / (count - 1.0) / count).sqrt() } else { f64::INFINITY };
    PartCost { cpu_s: mean, standard_error_s }
}

/// What every part of every family costs; nothing where no time is given for it.
pub(super) fn prices(plan: &Plan, sample: &Sample, options: &Options) -> Result<Vec<FamilyCost>, EstimateError> {
    let scenes_of = |family: usize| sample.strata.iter().find(|s| s.family == family).map_or(0.0, |s| s.scenes);
    let mut costs: Vec<FamilyCost> = (0..plan.families.len())
        .map(|family| FamilyCost { scenes: scenes_of(family).round() as u64, scene_s: None, parts: Vec::new() })
        .collect();
    if options.parts_limit.is_zero() {
        return Ok(costs);
    }
    let pairs = sample.strata.iter().map(|stratum| Pairs::new(plan, stratum.family, &stratum.order));
    let pairs = Mutex::new(pairs.collect::<Result<Vec<_>, _>>()?);
    let started = Instant::now();
    let lock = || pairs.lock().expect("no thread panics while it holds the pairs");
    // The family that has had the fewest scenes, until all are known or the time is over; each has one at least.
    let next = || {
        if options.stopped() {
            return None;
        }
        let mut pairs = lock();
        let late = started.elapsed() > options.parts_limit;
        let open = pairs.iter_mut().enumerate().filter(|(_, p)| !p.is_known() && (!late || p.begun == 0));
        let (family, chosen) = open.min_by_key(|(_, p)| p.begun)?;
        chosen.begun += 1;
        Some((family, chosen.order[chosen.begun - 1], chosen.begun))
    };
    let prepared: Vec<Vec<Prepared>> = lock().iter_mut().map(|p| std::mem::take(&mut p.prepared)).collect();
    let one_thread = || {
        let mut scratch = Scratch::default();
        let mut warm = false;
        while let Some((family, scene, turn)) = next() {
            if !std::mem::replace(&mut warm, true) {
                interleaved(&prepared[family][..1], scene, 0, &mut scratch);
            }
            let taken = interleaved(&prepared[family], scene, turn, &mut scratch);
            lock()[family].taken_s.push(taken.iter().map(|costs| costs.whole.cpu).collect());
        }
    };
    std::thread::scope(|scope| (0..options.threads).for_each(|_| _ = scope.spawn(one_thread)));
    if options.stopped() {
        return Ok(costs);
    }
    let pairs = pairs.into_inner().expect("no thread panics while it holds the pairs");
    for (stratum, pairs) in sample.strata.iter().zip(&pairs) {
        let cost = &mut costs[stratum.family];
        let whole: Vec<f64> = pairs.taken_s.iter().map(|s| s[0]).collect();
        cost.scene_s = Some(mean_with_error(&whole).cpu_s);
        cost.parts = (0..pairs.parts.len()).map(|k| (pairs.parts[k], pairs.price(k))).collect();
    }
    Ok(costs)
}
