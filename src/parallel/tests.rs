use super::*;

/// Numbers below a bound, and the sum of their squares; stops at an output.
struct Squares {
    next: u64,
    end: u64,
    sum: u64,
    taken: u64,
    stop_at: Option<u64>,
}

impl Schedule for Squares {
    type Task = u64;
    type Output = (u64, u64);

    fn next(&mut self) -> Option<u64> {
        (self.next < self.end).then(|| {
            self.next += 1;
            self.next - 1
        })
    }

    fn take(&mut self, (number, square): (u64, u64)) -> ControlFlow<()> {
        self.sum += square;
        self.taken += 1;
        if self.stop_at == Some(number) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

fn squares(end: u64, stop_at: Option<u64>) -> Squares {
    Squares { next: 0, end, sum: 0, taken: 0, stop_at }
}

#[test]
fn exact_every_task_is_done_once_on_any_number_of_threads() {
    for threads in [0, 1, 3, 64] {
        let mut schedule = squares(1000, None);
        run(threads, &mut schedule, |number, done: &mut u64| {
            *done += 1;
            (number, number * number)
        })
        .unwrap();
        assert_eq!((schedule.taken, schedule.sum), (1000, (0..1000).map(|k: u64| k * k).sum()));
    }
    run(2, &mut squares(0, None), |number, (): &mut ()| (number, 0)).unwrap();
}

#[test]
fn law_no_task_is_begun_behind_a_break_but_those_that_are_out() {
    let mut schedule = squares(1000, Some(10));
    run(2, &mut schedule, |number, (): &mut ()| (number, 0)).unwrap();
    assert!((11..=20).contains(&schedule.next), "{}", schedule.next);
}

#[test]
fn exact_a_map_keeps_the_order_and_ends_at_an_error_or_a_stop() {
    let stop = AtomicBool::new(false);
    let items: Vec<u64> = (0..200).collect();
    let mut told = 0;
    let made = map(5, items.clone(), &stop, |k, (): &mut ()| Ok::<_, PoolError>(2 * k), |done| told = done);
    assert_eq!((made.unwrap().unwrap(), told), ((0..200).map(|k| 2 * k).collect(), 200));
    let refuse = |k, (): &mut ()| match k {
        70 => Err(PoolError { threads: 70, reason: "a test".into() }),
        _ => Ok(k),
    };
    assert_eq!(map(5, items.clone(), &stop, refuse, |_| ()).unwrap_err().threads, 70);
    let raise = |done| stop.fetch_or(done == 50, Ordering::Relaxed);
    let made = map(5, items, &stop, |k, (): &mut ()| Ok::<_, PoolError>(k), |done| _ = raise(done));
    assert!(made.unwrap().is_none());
}

#[test]
fn law_what_takes_an_output_may_end_the_whole() {
    let stop = AtomicBool::new(false);
    let mut taken = Vec::new();
    let refused = for_each(
        2,
        (0..100).collect(),
        &stop,
        |k: usize, (): &mut ()| Ok(k),
        |k| {
            taken.push(k);
            if taken.len() < 5 { Ok(()) } else { Err(PoolError { threads: taken.len(), reason: "a test".into() }) }
        },
    );
    assert_eq!((refused.unwrap_err().threads, taken.len()), (5, 5));
    let all = |stop: &AtomicBool| for_each(2, vec![1, 2], stop, |_, (): &mut ()| Ok::<_, PoolError>(()), Ok).unwrap();
    assert!(all(&stop));
    assert!(!all(&AtomicBool::new(true)));
}

#[test]
fn law_every_thread_is_at_it_at_once() {
    // Nobody passes before all have come.
    let barrier = std::sync::Barrier::new(5);
    assert_eq!(on_every_thread(5, || usize::from(barrier.wait().is_leader())).unwrap().iter().sum::<usize>(), 1);
    assert_eq!(on_every_thread(0, || ()).unwrap().len(), 1);
}

#[test]
#[should_panic(expected = "task 7")]
fn law_a_panic_of_a_task_reaches_the_caller() {
    _ = run(3, &mut squares(100, None), |number, (): &mut ()| {
        assert_ne!(number, 7, "task {number}");
        (number, 0)
    });
}
