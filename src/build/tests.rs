//! The schedule alone: scenes that cost nothing, wait, or panic.

use std::sync::atomic::AtomicU32;

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
fn law_scenes_in_flight_are_bounded_by_the_window() {
    let (per_shard, threads) = (4, 2);
    let made = AtomicU32::new(0);
    let toy = Toy::new(per_shard, 4000, |_, _| {
        made.fetch_add(1, Ordering::Relaxed);
    });
    let shards: Vec<u64> = (0..1000).collect();
    let laid = AtomicU32::new(0);
    let on_push = || {
        let (made, laid) = (made.load(Ordering::Relaxed), laid.fetch_add(1, Ordering::Relaxed));
        assert!(made as usize <= laid as usize + per_shard + 2 * threads, "{made} scenes made, {laid} laid");
    };
    let (outcome, _) = build_until(&AtomicBool::new(false), &toy, &shards, threads, on_push, |_| Ok(()));
    assert_eq!(outcome.unwrap(), Outcome::Done);
    assert_eq!(laid.into_inner(), 4000);
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
