//! Wall time, and the CPU time of the calling thread: what a stage, or learning, costs when threads share cores.

use std::time::Instant;

use crate::episode::{StageObserver, StageTimes};
use crate::random::Stage;
use crate::train::memory::Event;

/// Seconds that this thread has spent on a CPU (Linux).
pub fn thread_cpu_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Seconds of CPU and of wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    pub cpu: f64,
    pub wall: f64,
}

/// What one scene took, whole and by stage (in the order of [`StageTimes::STAGES`]).
#[derive(Clone, Copy, Debug)]
pub struct Costs {
    pub whole: Seconds,
    pub stages: [Seconds; StageTimes::STAGES.len()],
    pub rays: u64,
    begun: (f64, Instant),
    since: (f64, Instant),
}

impl Costs {
    pub fn start() -> Costs {
        let now = now();
        Costs { whole: Seconds::default(), stages: Default::default(), rays: 0, begun: now, since: now }
    }

    /// The scene is made.
    pub fn finish(mut self) -> Costs {
        self.whole = passed(self.begun, now());
        self
    }
}

/// CPU seconds that a training from memory spends learning, without its looks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LearningTime {
    pub cpu_s: f64,
    since_s: f64,
}

impl LearningTime {
    pub(crate) fn start() -> LearningTime {
        LearningTime { cpu_s: 0.0, since_s: thread_cpu_s() }
    }

    /// To be told each event of the training.
    pub(crate) fn hear(&mut self, event: Event) {
        let now_s = thread_cpu_s();
        if let Event::Rows(_) = event {
            self.cpu_s += now_s - self.since_s;
        }
        self.since_s = now_s;
    }
}

fn now() -> (f64, Instant) {
    (thread_cpu_s(), Instant::now())
}

fn passed(from: (f64, Instant), to: (f64, Instant)) -> Seconds {
    Seconds { cpu: to.0 - from.0, wall: (to.1 - from.1).as_secs_f64() }
}

impl StageObserver for Costs {
    fn begin(&mut self) {
        self.since = now();
    }

    fn end(&mut self, stage: Stage, _: impl FnOnce(&mut blake3::Hasher)) {
        let to = now();
        if let Some(k) = StageTimes::STAGES.iter().position(|(s, _)| *s == stage) {
            let Seconds { cpu, wall } = passed(self.since, to);
            self.stages[k].cpu += cpu;
            self.stages[k].wall += wall;
        }
        self.since = to;
    }

    fn count_rays(&mut self, rays: u64) {
        self.rays += rays;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_cpu_time_stands_still_while_the_thread_sleeps_and_runs_while_it_works() {
        let before = thread_cpu_s();
        std::thread::sleep(std::time::Duration::from_millis(60));
        let slept = thread_cpu_s() - before;
        let started = thread_cpu_s();
        let mut sum = 0.0;
        while thread_cpu_s() - started < 0.02 {
            sum += 1.0;
        }
        assert!(slept < 0.03 && sum > 0.0, "{slept}");
    }
}
