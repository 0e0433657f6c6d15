//! A plan -> some of its scenes, run as a build runs them: what each took and gave.
//!
//! A thread runs its first scene twice and counts the second time, unless the scene is so long that warmth cannot matter. Which scene
//! comes next, and what all of them take, is told by `strata`.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::Clock;
use super::strata::{Sample, SceneCost, strata};
use crate::corpus::Split;
use crate::corpus::advice::Content;
use crate::episode::{Prepared, SceneOutput, Scratch, run_scene};
use crate::measure::clock::Costs;
use crate::parallel::{self, PoolError, Schedule};
use crate::plan::{Family, Plan};

/// Scenes of the test split that are looked through for how many are of which family.
const MOST_COUNTED: usize = 100_000;
/// A scene longer than this needs no warming.
const LONG: Duration = Duration::from_millis(500);

/// Runs scenes on all threads until enough is known.
pub(super) fn run(prepared: &Prepared, clock: &Clock) -> Result<Sample, PoolError> {
    let contents = contents(&prepared.plan);
    let sample = Sample { strata: strata(&prepared.plan), contents, outputs: Vec::new(), kept_rows: 0 };
    let mut sampling = Sampling { sample, clock, started: Instant::now() };
    parallel::run(
        clock.options.threads,
        &mut sampling,
        |(stratum, scene), (scratch, is_warm): &mut (Scratch, bool)| {
            let begun = Instant::now();
            // Tasks wait for a thread: by now all time may be spent.
            if clock.is_over() && *is_warm {
                return None;
            }
            let mut make = || {
                let mut costs = Costs::start();
                let output = run_scene(prepared, scene, scratch, &mut costs);
                (SceneCost::of(&costs.finish(), &output), output)
            };
            let mut made = make();
            if !std::mem::replace(is_warm, true) && begun.elapsed() < LONG {
                made = make();
            }
            Some((stratum, made.0, made.1))
        },
    )?;
    let mut sample = sampling.sample;
    sample.outputs.sort_by_key(|output| output.scene_id);
    Ok(sample)
}

/// Test scenes of each family.
pub(crate) fn test_scenes(plan: &Plan) -> Vec<u64> {
    let tests = (0..plan.shards()).filter(|&shard| Split::of_shard(shard) == Split::Test);
    let per_shard = u64::from(plan.scenes_per_shard);
    let mut test_scenes = vec![0; plan.families.len()];
    for scene in tests.flat_map(|shard| shard * per_shard..plan.scenes.min((shard + 1) * per_shard)).take(MOST_COUNTED)
    {
        test_scenes[plan.family_index_of(scene)] += 1;
    }
    test_scenes
}

/// By family: what is known of it before a scene is run.
fn contents(plan: &Plan) -> Vec<Content> {
    let families = plan.families.iter().zip(test_scenes(plan));
    let content = |(family, test_scenes): (&Family, u64)| {
        Content::of(&family.name, family.hold_out, test_scenes).with_grid(Some((&family.cells).into()))
    };
    families.map(content).collect()
}

/// Scenes of a sample as threads take them.
struct Sampling<'a> {
    sample: Sample,
    clock: &'a Clock<'a>,
    started: Instant,
}

impl Schedule for Sampling<'_> {
    type Task = (usize, u64);
    type Output = Option<(usize, SceneCost, SceneOutput)>;

    fn next(&mut self) -> Option<(usize, u64)> {
        let begun: usize = self.sample.strata.iter().map(|stratum| stratum.begun).sum();
        if begun > 0 && self.clock.is_over() {
            return None;
        }
        self.sample.next(self.clock.options, self.started)
    }

    fn take(&mut self, made: Self::Output) -> ControlFlow<()> {
        if let Some((stratum, cost, output)) = made {
            self.sample.add(stratum, cost, output);
        }
        ControlFlow::Continue(())
    }
}
