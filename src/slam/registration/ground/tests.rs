//! Planes of the ground, held against least squares written out; relief laid on itself after a known motion; too little ground and nonsense.

use super::super::tests::{fixed, reckoned};
use super::super::{Registration, Surface, register};
use super::*;
use crate::math;
use crate::random::{Purpose, Stage, Streams};
use crate::slam::matrix::{Vector, cholesky, half_solve, square};

/// Waves of half a metre to two, `height_m` high, in metres.
fn relief_m(height_m: f64, x: f64, y: f64) -> f64 {
    let wave = |k: usize, x: f64, y: f64| math::sin((1.9 + k as f64) * x + (1.3 - 0.7 * k as f64) * y + k as f64);
    height_m * (0..4).map(|k| wave(k, x, y)).sum::<f64>() / 2.0
}

/// Cells of the ground around a rover at (x, y, heading): of rings `ring_m` apart and rays a degree apart, between 0.8 and 5 m from it, in its level axes.
fn seen(height_m: f64, [x, y, heading_rad]: Vector<3>, ring_m: f64) -> Vec<DVec3> {
    let (sin, cos) = math::sin_cos(heading_rad);
    let rings = (0..).map(|k| 0.8 + ring_m * f64::from(k)).take_while(|r| *r < 5.0);
    rings
        .flat_map(|range_m| (0..360).map(move |ray| (range_m, f64::from(ray).to_radians())))
        .map(|(range_m, bearing_rad)| {
            let (s, c) = math::sin_cos(bearing_rad);
            let (ahead, left) = (range_m * c, range_m * s);
            let z = relief_m(height_m, x + cos * ahead - sin * left, y + sin * ahead + cos * left);
            DVec3::new(ahead, left, z)
        })
        .collect()
}

fn ground(cells_m: Vec<DVec3>) -> Surface {
    Surface::default().with_ground(cells_m.into_iter())
}

#[test]
fn equal_a_plane_and_the_least_squares_of_the_cells_around_its_node() {
    let cells = seen(0.05, [0.3, -0.7, 0.4], 0.11);
    let map = GroundMap::of(cells.iter().copied());
    assert!(map.len() > 800, "{}", map.len());
    let mut judged = 0;
    for (at, plane) in map.planes.iter().enumerate().filter_map(|(at, plane)| Some((at, plane.as_ref()?))).step_by(37) {
        let node = [at % map.width, at / map.width].map(|k| k as i64);
        let [column, row] = [0, 1].map(|axis| node[axis] + map.first[axis]);
        let reach = REACH as i64;
        let within = |t_m: f64, k: i64| ((t_m / NODE_M).floor() as i64 - k).abs() <= reach;
        let near: Vec<DVec3> = cells.iter().copied().filter(|c| within(c.x, column) && within(c.y, row)).collect();
        let design = nalgebra::DMatrix::from_fn(near.len(), 3, |r, c| [near[r].x, near[r].y, 1.0][c]);
        let heights = nalgebra::DVector::from_fn(near.len(), |r, _| near[r].z);
        let solved = design.svd(true, true).solve(&heights, 1e-12).expect("three slopes");
        let normal = DVec3::new(-solved[0], -solved[1], 1.0).normalize();
        let mean_m = near.iter().sum::<DVec3>() / near.len() as f64;
        assert!((plane.normal - normal).length() < 1e-9 && (plane.place_m - mean_m).length() < 1e-9, "{at}");
        assert_eq!(map.at(DVec3::new((column as f64 + 0.5) * NODE_M, (row as f64 + 0.5) * NODE_M, 9.0)), Some(plane));
        judged += 1;
    }
    assert!(judged > 20, "{judged}");
}

#[test]
fn exact_relief_seen_from_two_places_tells_the_way_between_them() {
    let moved = [0.35, -0.15, 0.08];
    // Rings of the beams go along with the rover: nearest points would lie ring on ring.
    let (before, after) = (ground(seen(0.05, [0.0; 3], 0.1)), ground(seen(0.05, moved, 0.1)));
    for (east, north, turn) in [(0.0, 0.0, 0.0), (0.06, -0.05, 0.03), (-0.08, 0.05, -0.04)] {
        let guess = reckoned([moved[0] + east, moved[1] + north, moved[2] + turn], [0.06, 0.06, 0.04]);
        let fix = fixed(register(&after, &before, &guess));
        let off = fix.innovation(&moved);
        // A plane over a metre of such waves is not quite the same from other rings.
        assert!(off[0].abs() < 0.015 && off[1].abs() < 0.015 && off[2].abs() < 0.004, "{off:?}");
        assert!(fix.covariance[0][0] < 0.03 * 0.03 && fix.covariance[2][2] < 0.02 * 0.02, "{fix:?}");
    }
}

/// Errors squared over what is stated, a degree of freedom, and root mean squares: over 100 pairs of sweeps of cells that err by `sigma_m`.
fn nees_of(height_m: f64, sigma_m: f64, sigmas: Vector<3>) -> (f64, Vector<3>) {
    let moved = [0.35, -0.15, 0.08];
    let streams = Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 };
    let (mut nees, mut squares, mut count) = (0.0, [0.0; 3], 0.0);
    for pair in 0..100 {
        let blurred = |pose: Vector<3>, step: u32| {
            let mut cells_m = seen(height_m, pose, 0.1);
            let mut noise = vec![0.0; cells_m.len()];
            streams.at_step(step).open(Purpose::SweepRangeNoise).fill_normal(0, &mut noise);
            cells_m.iter_mut().zip(noise).for_each(|(cell_m, noise)| cell_m.z += sigma_m * noise);
            ground(cells_m)
        };
        let (before, after) = (blurred([0.0; 3], 2 * pair), blurred(moved, 2 * pair + 1));
        let guessed = streams.at_step(pair).open(Purpose::SlamSample);
        let guess: Vector<3> = std::array::from_fn(|k| moved[k] + sigmas[k] * guessed.normal(k as u64));
        let Registration::Fixed(fix) = register(&after, &before, &reckoned(guess, sigmas)) else { continue };
        let off = fix.innovation(&moved);
        nees += square(&half_solve(&cholesky(&fix.covariance).expect("positive definite"), &off)) / 3.0;
        (0..3).for_each(|k| squares[k] += off[k] * off[k]);
        count += 1.0;
    }
    assert!(count >= 90.0, "{count} fixes");
    (nees / count, squares.map(|s| (s / count).sqrt()))
}

#[test]
fn dist_of_relief_with_noisy_cells_a_fix_errs_no_more_than_it_states() {
    let (nees, rms) = nees_of(0.05, 0.01, [0.06, 0.06, 0.04]);
    assert!((0.1..1.3).contains(&nees), "{nees}");
    assert!(rms[0] < 0.015 && rms[1] < 0.015 && rms[2] < 0.006, "{rms:?}");
}

#[test]
fn law_flat_ground_tells_of_no_way() {
    // All that its planes seem to tell is noise: the fix owns up to it.
    let streams = Streams { seed: 6, scene: 0, attempt: 0, stage: Stage::Sweep, step: 0 };
    let flat = |step: u32| {
        let mut cells_m = seen(0.0, [0.0; 3], 0.1);
        let mut noise = vec![0.0; cells_m.len()];
        streams.at_step(step).open(Purpose::SweepRangeNoise).fill_normal(0, &mut noise);
        cells_m.iter_mut().zip(noise).for_each(|(cell_m, noise)| cell_m.z += 0.005 * noise);
        ground(cells_m)
    };
    for pair in 0..20 {
        let guess = reckoned([0.3, 0.0, 0.0], [0.05, 0.05, 0.03]);
        match register(&flat(2 * pair), &flat(2 * pair + 1), &guess) {
            Registration::Fixed(fix) => {
                let sigma = |k: usize| fix.covariance[k][k].sqrt();
                assert!(sigma(0) > 0.05 && sigma(1) > 0.05 && sigma(2) > 0.02, "{pair}: {fix:?}");
            }
            // What the normals' errors add is more than all that is told, or the rest tells nothing.
            Registration::Apart => {}
            Registration::Gated => panic!("{pair}: sure of what is not there"),
        }
    }
}

#[test]
fn law_a_few_standing_points_tell_nothing_beside_level_ground() {
    let upright = |x_m: f64| (0..6).map(move |k| DVec3::new(x_m, 1.0 + 0.05 * f64::from(k % 3), 0.03 * f64::from(k)));
    let of = |x_m: f64| Surface::of(upright(x_m)).with_ground(seen(0.0, [0.0; 3], 0.1).into_iter());
    let guess = reckoned([0.0; 3], [0.05, 0.05, 0.03]);
    // Less than twenty of them, and displaced: of the way nothing is known.
    match register(&of(2.05), &of(2.0), &guess) {
        Registration::Fixed(fix) => assert!(fix.covariance[0][0] > 0.05 * 0.05, "{fix:?}"),
        other => assert_eq!(other, Registration::Apart),
    }
}

#[test]
fn law_ground_elsewhere_is_apart_and_a_step_is_no_plane() {
    let before = ground(seen(0.05, [0.0; 3], 0.1));
    let guess = reckoned([30.0, 0.0, 0.0], [0.06, 0.06, 0.04]);
    assert_eq!(register(&before, &before, &guess), Registration::Apart);
    // A step of 20 cm: planes on both sides of it, none across.
    let stepped = seen(0.0, [0.0; 3], 0.1).into_iter().map(|c| if c.x > 1.0 { c + 0.2 * DVec3::Z } else { c });
    let map = GroundMap::of(stepped);
    assert!(map.at(DVec3::new(1.0, 1.5, 0.0)).is_none());
    assert!(map.at(DVec3::new(2.0, 1.5, 0.0)).is_some_and(|plane| (plane.place_m.z - 0.2).abs() < 1e-9));
}

#[test]
fn extreme_nothing_one_ring_and_cells_that_are_no_numbers() {
    assert_eq!(GroundMap::of(std::iter::empty()), GroundMap::default());
    assert!(GroundMap::default().at(DVec3::ZERO).is_none());
    for broken in [DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e300), DVec3::new(1e6, 0.0, 0.0)] {
        let mixed = seen(0.05, [0.0; 3], 0.1).into_iter().flat_map(|cell_m| [cell_m, broken]);
        assert_eq!(GroundMap::of(mixed), GroundMap::of(seen(0.05, [0.0; 3], 0.1).into_iter()), "{broken}");
        assert!(GroundMap::default().at(broken).is_none());
        let whole = (0..900).map(|k| DVec3::new(0.1 * f64::from(k % 30) - 1.5, 0.1 * f64::from(k / 30) - 1.5, 0.0));
        let under_the_origin = GroundMap::of(whole);
        assert!(under_the_origin.at(DVec3::ZERO).is_some() && under_the_origin.at(broken).is_none(), "{broken}");
        assert!(GroundMap::of(seen(0.05, [0.0; 3], 0.1).into_iter()).at(broken).is_none(), "{broken}");
    }
    // A ring alone tells no slope across it; cells on one place none at all.
    let ring = seen(0.0, [0.0; 3], 10.0);
    assert!(ring.len() == 360 && GroundMap::of(ring.iter().map(|c| *c * 4.0)).len() == 0);
    assert_eq!(GroundMap::of(std::iter::repeat_n(DVec3::ONE, 500)).len(), 0);
    assert_eq!(register(&ground(ring.clone()), &ground(ring), &reckoned([0.0; 3], [0.1; 3])), Registration::Apart);
}
