//! The schedule alone: scenes that cost nothing, wait, or panic.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64};

use super::*;

/// Scenes numbered by their attempts; what they do is a function of their number and of how often they were made.
struct Toy<F> {
    per_shard: usize,
    made: Vec<AtomicU32>,
    behave: F,
}

impl<F: Fn(u64, u32) + Sync> Toy<F> {
    fn new(per_shard: usize, scenes: usize, behave: F) -> Toy<F> {
        Toy { per_shard, made: (0..scenes).map(|_| AtomicU32::new(0)).collect(), behave }
    }
}

impl<F: Fn(u64, u32) + Sync> Scenes for Toy<F> {
    fn per_shard(&self) -> usize {
        self.per_shard
    }

    fn make(&self, scene: u64, _: &mut Scratch, _: &mut StageRecord) -> SceneOutput {
        (self.behave)(scene, self.made[scene as usize].fetch_add(1, Ordering::Relaxed));
        SceneOutput { scene_id: scene, attempts: 1, ..SceneOutput::default() }
    }

    fn family(&self, _: u64) -> &str {
        "default"
    }
}

#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Refused(&'static str);

/// Keeps the scenes of shards; what it does at each scene and at the end of a shard is given.
struct Kept<P, C> {
    on_push: P,
    on_close: C,
    written: Mutex<BTreeMap<u64, Vec<SceneOutput>>>,
}

impl<P: Fn() + Sync, C: Fn(u64) -> Result<(), Refused> + Sync> Sink for Kept<P, C> {
    type Open = (u64, Vec<SceneOutput>);
    type Written = ();
    type Error = Refused;

    fn open(&self, shard: u64) -> Result<Self::Open, Refused> {
        Ok((shard, Vec::new()))
    }

    fn push(&self, open: &mut Self::Open, scene: SceneOutput) -> Result<(), Refused> {
        (self.on_push)();
        open.1.push(scene);
        Ok(())
    }

    fn close(&self, (shard, scenes): Self::Open) -> Result<(), Refused> {
        (self.on_close)(shard)?;
        assert!(self.written.lock().unwrap().insert(shard, scenes).is_none(), "shard {shard} was written twice");
        Ok(())
    }
}

type Built = (Result<Outcome, BuildError<Refused>>, BTreeMap<u64, Vec<SceneOutput>>);

fn build_with<F: Fn(u64, u32) + Sync>(
    toy: &Toy<F>,
    shards: &[u64],
    threads: usize,
    on_close: impl Fn(u64) -> Result<(), Refused> + Sync,
) -> Built {
    build_until(&AtomicBool::new(false), toy, shards, threads, || (), on_close)
}

fn build_until<F: Fn(u64, u32) + Sync>(
    stop: &AtomicBool,
    toy: &Toy<F>,
    shards: &[u64],
    threads: usize,
    on_push: impl Fn() + Sync,
    on_close: impl Fn(u64) -> Result<(), Refused> + Sync,
) -> Built {
    let kept = Kept { on_push, on_close, written: Mutex::default() };
    let outcome = build(toy, &kept, Job { shards, threads, stop, hashes: false }, |_| ());
    (outcome, kept.written.into_inner().unwrap())
}

#[test]
fn exact_every_shard_holds_its_own_scenes_in_order() {
    for threads in [1, 2, 5] {
        // Some scenes are slow, so that later ones overtake them.
        let toy = Toy::new(3, 40, |scene, _| std::thread::sleep(Duration::from_micros(scene * 7919 % 13 * 100)));
        let (outcome, written) = build_with(&toy, &[0, 2, 3, 7, 11], threads, |_| Ok(()));
        assert_eq!(outcome.unwrap(), Outcome::Done);
        assert_eq!(written.keys().copied().collect::<Vec<_>>(), [0, 2, 3, 7, 11]);
        for (shard, outputs) in written {
            let ids: Vec<u64> = outputs.iter().map(|output| output.scene_id).collect();
            assert_eq!(ids, (3 * shard..3 * shard + 3).collect::<Vec<_>>());
        }
    }
}

#[test]
fn law_a_scene_that_always_panics_has_failed_and_the_build_goes_on() {
    let toy = Toy::new(2, 8, |scene, _| assert!(scene != 5, "no way to build scene {scene}"));
    let (outcome, written) = build_with(&toy, &[0, 1, 2, 3], 2, |_| Ok(()));
    assert_eq!(outcome.unwrap(), Outcome::Done);
    let failed: Vec<(u64, &str)> =
        written.values().flatten().filter_map(|o| o.error.as_deref().map(|e| (o.scene_id, e))).collect();
    assert_eq!(failed.len(), 1);
    assert_eq!(failed[0].0, 5);
    assert!(failed[0].1.starts_with("panicked: no way to build scene 5; this is a bug of marsyard"), "{failed:?}");
}

#[test]
fn law_a_scene_that_panics_once_or_in_other_words_stops_the_build() {
    for (second, says) in [(false, "again it did not"), (true, "again it panicked otherwise (time 1)")] {
        let toy = Toy::new(2, 8, |scene, time| assert!(scene != 3 || (time > 0 && !second), "time {time}"));
        let error = build_with(&toy, &[0, 1, 2, 3], 2, |_| Ok(())).0.unwrap_err().to_string();
        assert!(error.contains("scene 3 panicked (time 0)") && error.contains(says), "{error}");
    }
}

#[test]
fn law_a_shard_that_cannot_be_written_or_panics_ends_the_build() {
    let toy = || Toy::new(1, 100, |_, _| ());
    let shards: Vec<u64> = (0..100).collect();
    let (outcome, written) =
        build_with(&toy(), &shards, 3, |shard| if shard == 7 { Err(Refused("disk full")) } else { Ok(()) });
    assert!(matches!(outcome, Err(BuildError::Write(Refused("disk full")))), "{outcome:?}");
    assert!(!written.contains_key(&7));
    let (outcome, _) = build_with(&toy(), &shards, 3, |shard| {
        assert!(shard != 7, "a bug");
        Ok(())
    });
    assert!(matches!(outcome, Err(BuildError::Panic { shard: 7, .. })), "{outcome:?}");
}

#[test]
fn law_scenes_that_wait_are_bounded_whatever_a_shard_holds() {
    // Writing takes longer than making, or one scene of each shard holds up those behind it.
    for (slow_write, slow_scene) in [(true, false), (false, true)] {
        for (per_shard, threads) in [(4, 2), (500, 2), (50, 8)] {
            let (made, pushed) = (AtomicU32::new(0), AtomicU32::new(0));
            let toy = Toy::new(per_shard, 1000, |scene, _| {
                if slow_scene && scene % per_shard as u64 == 1 {
                    std::thread::sleep(Duration::from_millis(5));
                }
                made.fetch_add(1, Ordering::Relaxed);
            });
            let limits = open_shards::Limits::of_threads(threads);
            let most = limits.unwritten(limits.open);
            let on_push = || {
                if slow_write {
                    std::thread::sleep(Duration::from_micros(100));
                }
                let (made, pushed) = (made.load(Ordering::Relaxed), pushed.fetch_add(1, Ordering::Relaxed));
                assert!(
                    made as usize <= pushed as usize + most,
                    "{made} scenes made, {pushed} pushed, {most} may wait"
                );
            };
            let shards: Vec<u64> = (0..1000 / per_shard as u64).collect();
            let (outcome, _) = build_until(&AtomicBool::new(false), &toy, &shards, threads, on_push, |_| Ok(()));
            assert_eq!(outcome.unwrap(), Outcome::Done);
            assert_eq!(pushed.into_inner(), 1000);
        }
    }
}

/// A part of a corpus whose stages sleep: milliseconds of a scene, of its rows, and of what makes a shard whole.
struct Sleeping {
    name: &'static str,
    per_shard: usize,
    scene_ms: f64,
    rows_ms: f64,
    close_ms: f64,
}

/// Efficiency of the schedule where scenes sleep instead of computing, so that two cores hold 64 threads:
///
///     cargo test --release --lib build::shards::tests::study -- --ignored --nocapture
#[test]
#[ignore = "a study of two minutes: prints a table, docs/architecture.md shows it"]
fn study_of_sleeping_scenes() {
    let kinds = [
        Sleeping { name: "paper, 50 scenes a shard", per_shard: 50, scene_ms: 11.2, rows_ms: 1.1, close_ms: 8.0 },
        Sleeping { name: "paper, 500 scenes a shard", per_shard: 500, scene_ms: 11.2, rows_ms: 1.1, close_ms: 60.0 },
        Sleeping { name: "ten kept sweeps, 50", per_shard: 50, scene_ms: 36.6, rows_ms: 10.5, close_ms: 60.0 },
        Sleeping { name: "ten kept sweeps, 500", per_shard: 500, scene_ms: 36.6, rows_ms: 10.5, close_ms: 400.0 },
        Sleeping { name: "with the points table, 50", per_shard: 50, scene_ms: 11.2, rows_ms: 24.5, close_ms: 60.0 },
    ];
    println!("| scenes | 16 threads | 32 threads | 64 threads |\n|---|--:|--:|--:|");
    for Sleeping { name, per_shard, scene_ms, rows_ms, close_ms } in kinds {
        let shares = [16, 32, 64].map(|threads| {
            let count = 4 * threads;
            // Until the last quarter is begun: what a night's last shards cost, written by one thread each, is none of its rate.
            let behind = (3 * threads * per_shard) as u64;
            let (worked_us, until_behind) = (AtomicU64::new(0), Mutex::new(0.0));
            let started = Instant::now();
            let work = |ms: f64| {
                // Four times as fast as in truth, so that the schedule costs four times its share.
                let ms = 0.25 * ms;
                std::thread::sleep(Duration::from_secs_f64(1e-3 * ms));
                worked_us.fetch_add((1e3 * ms) as u64, Ordering::Relaxed);
            };
            // Every scene takes its time by its number, from a half to one and a half of the mean.
            let toy = Toy::new(per_shard, count * per_shard, |scene, _| {
                if scene == behind {
                    let ideal_s = started.elapsed().as_secs_f64() * threads as f64;
                    *until_behind.lock().unwrap() = 1e-6 * worked_us.load(Ordering::Relaxed) as f64 / ideal_s;
                }
                work(scene_ms * (0.5 + (scene * 7919 % 1000) as f64 / 1000.0));
            });
            let shards: Vec<u64> = (0..count as u64).collect();
            let on_close = |_: u64| {
                work(close_ms);
                Ok(())
            };
            let stop = AtomicBool::new(false);
            let (outcome, _) = build_until(&stop, &toy, &shards, threads, || work(rows_ms), on_close);
            assert_eq!(outcome.unwrap(), Outcome::Done);
            format!("{:.0} %", 100.0 * until_behind.into_inner().unwrap())
        });
        println!("| {name} | {} |", shares.join(" | "));
    }
}

#[test]
fn law_a_stop_writes_every_shard_whose_scenes_were_all_begun() {
    for last in [0, 3, 7, 22] {
        let stop = AtomicBool::new(false);
        let toy = Toy::new(4, 40, |scene, _| {
            std::thread::sleep(Duration::from_micros(scene * 7919 % 13 * 100));
            stop.fetch_or(scene == last, Ordering::Relaxed);
        });
        let (outcome, written) = build_until(&stop, &toy, &(0..10).collect::<Vec<_>>(), 3, || (), |_| Ok(()));
        assert!(matches!(outcome, Ok(Outcome::Interrupted)), "{outcome:?}");
        let made = |shard: &u64| toy.made[4 * *shard as usize..][..4].iter().all(|m| m.load(Ordering::Relaxed) == 1);
        assert_eq!(written.keys().copied().collect::<Vec<_>>(), (0..10).filter(made).collect::<Vec<_>>());
    }
}
