//! A family and each part that it switches on -> what that part costs.
//!
//! The same scenes (same addresses, so the same draws) with the part and without it, interleaved, on one thread each: CPU time,
//! mean of the differences. What a part costs elsewhere is in its price: rocks bring features that FastSLAM must match, FastSLAM
//! reads sweeps that nobody keeps. So prices need not add up to the whole. A scene is measured at one attempt; further attempts
//! are a part of their own, for whether an attempt is repeated must not decide what dropout costs. The time of writing is not
//! in it but for tables, which `encode` measures.

use std::ops::ControlFlow;
use std::time::Instant;

use super::part::Part;
use super::strata::Sample;
use super::{Clock, EstimateError, FamilyCost};
use crate::episode::{Prepared, Scratch, run_scene};
use crate::measure::clock::Costs;
use crate::measure::interleave::{Repeats, rotated, try_rotated};
use crate::parallel::{self, Schedule};
use crate::plan::Plan;

/// A standard error of a price, relative to the whole scene, at which measuring ends.
const ENOUGH: f64 = 0.003;
/// Repeats before a standard error means anything.
const FIRST: usize = 4;
/// Repeats that are begun though the limit is over: one alone has no error.
const LEAST: usize = 2;
/// Among the variants of a family: the plan at one attempt. Part k is variant k + 1.
const ONE_ATTEMPT: usize = 0;

/// CPU seconds a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PartCost {
    pub cpu_s: f64,
    pub standard_error_s: f64,
}

impl PartCost {
    /// More than twice its standard error from nothing.
    pub(crate) fn is_told_apart(&self) -> bool {
        self.cpu_s.abs() > 2.0 * self.standard_error_s
    }

    /// What it costs at most, as far as was measured: two standard errors above the figure.
    pub(crate) fn most_s(&self) -> f64 {
        self.cpu_s.max(0.0) + 2.0 * self.standard_error_s
    }
}

/// What one scene takes under each plan, interleaved; which plan comes first turns with `repeat`.
pub fn scene_costs(prepared: &[Prepared], scene: u64, repeat: usize, scratch: &mut Scratch) -> Vec<Costs> {
    rotated(prepared.len(), repeat, |k| scene_cost(&prepared[k], scene, scratch))
}

fn scene_cost(prepared: &Prepared, scene: u64, scratch: &mut Scratch) -> Costs {
    let mut costs = Costs::start();
    std::hint::black_box(run_scene(prepared, scene, scratch, &mut costs));
    costs.finish()
}

/// The plans that are compared for one family: at one attempt, and for each part the plan that differs by it.
fn variants(whole: &Prepared, family: usize, parts: &[Part]) -> Result<Vec<Prepared>, EstimateError> {
    let plan = &whole.plan;
    let mut once = plan.clone();
    Part::Attempts.leave_out(&mut once, family);
    let other = |part: &Part| match part {
        // Further attempts are what the plan has and the measured scene has not.
        Part::Attempts => plan.clone(),
        part => {
            let mut without = once.clone();
            part.leave_out(&mut without, family);
            without
        }
    };
    let others: Vec<Plan> = parts.iter().map(other).collect();
    // No part changes a sensor: the beams are laid out once for all.
    let prepared = std::iter::once(once).chain(others).map(|plan| whole.with_plan(plan));
    Ok(prepared.collect::<Result<_, _>>()?)
}

/// What is measured of one family.
struct FamilyTimes {
    parts: Vec<Part>,
    /// Numbers of its scenes, each prefix spread over the plan.
    order: Vec<u64>,
    begun: usize,
    /// CPU seconds of a scene under each variant.
    cpu_s: Repeats,
}

impl FamilyTimes {
    fn price(&self, k: usize) -> Option<PartCost> {
        let saved_s = self.cpu_s.moments_of_difference(ONE_ATTEMPT, k + 1)?;
        // The other variant is the one without the part, but for further attempts.
        let sign = if self.parts[k] == Part::Attempts { -1.0 } else { 1.0 };
        Some(PartCost { cpu_s: sign * saved_s.mean, standard_error_s: saved_s.standard_error() })
    }

    fn is_known(&self) -> bool {
        let enough_s = self.cpu_s.moments(ONE_ATTEMPT).map_or(0.0, |scene_s| ENOUGH * scene_s.mean);
        let is_known = |k| self.price(k).is_some_and(|price| price.standard_error_s < enough_s);
        self.begun >= self.order.len() || self.cpu_s.len() >= FIRST && (0..self.parts.len()).all(is_known)
    }
}

/// Scenes that are measured until all prices are known or the time is over.
struct Pricing<'a> {
    families: Vec<FamilyTimes>,
    clock: &'a Clock<'a>,
    started: Instant,
}

/// One scene of one family, under all its variants.
struct Repeat {
    family: usize,
    scene: u64,
    number: usize,
}

impl Schedule for Pricing<'_> {
    type Task = Repeat;
    type Output = Option<(usize, Vec<f64>)>;

    /// The family that has had the fewest scenes; each has two at least.
    fn next(&mut self) -> Option<Repeat> {
        if self.clock.is_over() {
            return None;
        }
        let is_late = self.started.elapsed() > self.clock.options.parts_limit;
        let families = self.families.iter_mut().enumerate();
        let open = families.filter(|(_, times)| !times.is_known() && (!is_late || times.begun < LEAST));
        let (family, times) = open.min_by_key(|(_, times)| times.begun)?;
        times.begun += 1;
        Some(Repeat { family, scene: times.order[times.begun - 1], number: times.begun })
    }

    fn take(&mut self, measured: Self::Output) -> ControlFlow<()> {
        if let Some((family, cpu_s)) = measured {
            self.families[family].cpu_s.push(cpu_s);
        }
        ControlFlow::Continue(())
    }
}

/// What every part of every family costs; nothing where no time is given for it.
pub(super) fn prices(whole: &Prepared, sample: &Sample, clock: &Clock) -> Result<Vec<FamilyCost>, EstimateError> {
    let options = clock.options;
    let plan = &whole.plan;
    let scenes_of = |family: usize| sample.strata.iter().find(|s| s.family == family).map_or(0.0, |s| s.scenes);
    let mut costs: Vec<FamilyCost> = (0..plan.families.len())
        .map(|family| FamilyCost { scenes: scenes_of(family).round() as u64, scene_s: None, parts: Vec::new() })
        .collect();
    if options.parts_limit.is_zero() {
        return Ok(costs);
    }
    let (mut families, mut prepared) = (Vec::new(), Vec::new());
    for stratum in &sample.strata {
        let parts: Vec<Part> = Part::ALL.into_iter().filter(|part| part.is_on(plan, stratum.family)).collect();
        prepared.push(variants(whole, stratum.family, &parts)?);
        families.push(FamilyTimes { parts, order: stratum.order.clone(), begun: 0, cpu_s: Repeats::default() });
    }
    let started = Instant::now();
    let mut pricing = Pricing { families, clock, started };
    let one_scene = |repeat: Repeat, (scratch, is_warm): &mut (Scratch, bool)| {
        let Repeat { family, scene, number } = repeat;
        // Tasks wait for a thread: by now the time may be over, and a family's first scenes are measured all the same.
        if clock.is_over() || number > LEAST && started.elapsed() > options.parts_limit {
            return None;
        }
        if !std::mem::replace(is_warm, true) {
            scene_costs(&prepared[family][..1], scene, 0, scratch);
        }
        // A scene that lacks a variant when all time is spent tells nothing.
        let plans = &prepared[family];
        let cpu_s = try_rotated(plans.len(), number, |k| match clock.is_over() {
            true => Err(()),
            false => Ok(scene_cost(&plans[k], scene, scratch).whole.cpu),
        });
        Some((family, cpu_s.ok()?))
    };
    parallel::run(options.threads, &mut pricing, one_scene)?;
    if options.stopped() {
        return Ok(costs);
    }
    for (stratum, times) in sample.strata.iter().zip(&pricing.families) {
        let cost = &mut costs[stratum.family];
        cost.scene_s = times.cpu_s.moments(ONE_ATTEMPT).map(|scene_s| scene_s.mean);
        cost.parts = (0..times.parts.len()).filter_map(|k| Some((times.parts[k], times.price(k)?))).collect();
    }
    Ok(costs)
}
