//! What a stand must be, on grounds whose answer is known and on grounds where it can be checked.

mod extremes;

use super::super::fixtures::{ROVERS, hills, kapvik, pioneer, plane, raster, rover, rubble, streams};
use super::super::linkage::Linkage;
use super::super::params::ContactSolver;
use super::super::surface::Surface;
use super::super::{DriveError, Rover};
use super::nelder_mead::minimise;
use super::residual::{GroundDerivatives, Problem, UNKNOWNS, Unknowns, sum_of_squares};
use super::{ContactPose, GroundContact, unknowns_of};
use crate::geometry::{DVec2, DVec3};
use crate::math;
use crate::random::Purpose;
use crate::scene::{Ground, Polynomial, Scene};

const SOLVERS: [ContactSolver; 3] = [ContactSolver::GaussNewton, ContactSolver::NelderMead, ContactSolver::PlaneFit];

/// Places and headings all over a yard, a metre from its edge.
fn places(seed: u64, extent_m: f64, count: u64) -> impl Iterator<Item = (f64, f64, f64)> {
    let draws = streams(seed).open(Purpose::StartPlace);
    (0..count).map(move |k| {
        let along = |k| 1.0 + (extent_m - 2.0) * draws.uniform(k);
        (along(3 * k), along(3 * k + 1), 6.2 * draws.uniform(3 * k + 2) - 3.1)
    })
}

fn unknown_count(rover: &Rover) -> usize {
    if Linkage::new(rover).articulated() { UNKNOWNS } else { 3 }
}

#[test]
fn exact_on_planes_every_wheel_touches_and_the_tilt_is_the_planes_at_every_heading() {
    for yaml in ROVERS {
        let rover = rover(yaml);
        for solver in SOLVERS {
            for slope in [DVec2::ZERO, DVec2::new(0.3, -0.2), DVec2::new(-0.1, 0.4)] {
                let scene = plane(20.0, 0.7, slope);
                let contact = GroundContact::new(&rover, &scene, solver);
                for k in 0..24 {
                    let yaw = math::wrap_angle(f64::from(k) * std::f64::consts::TAU / 24.0);
                    let stance = contact.stand(9.0, 11.0, yaw, None).unwrap();
                    let (sin, cos) = math::sin_cos(yaw);
                    // The rover's x axis climbs with the slope ahead; its z axis is the plane's normal.
                    let pitch = -math::atan(slope.x * cos + slope.y * sin);
                    let normal = DVec3::new(-slope.x, -slope.y, 1.0).normalize();
                    assert!((stance.pose.pitch_rad - pitch).abs() < 1e-9, "{solver:?} {yaw}: {stance:?}");
                    assert!((stance.pose.rotation().z_axis - normal).length() < 1e-9, "{solver:?} {yaw}: {stance:?}");
                    assert!((stance.pose.position_m.z - (0.7 + slope.dot(DVec2::new(9.0, 11.0)))).abs() < 1e-9);
                    assert!(stance.contact.residual_m < 1e-9, "{solver:?} {yaw}: {stance:?}");
                    assert!(stance.contact.rocker_rad.abs() < 1e-8 && stance.contact.bogie_left_rad.abs() < 1e-8);
                }
            }
        }
    }
}

#[test]
fn exact_a_rough_raster_of_a_plane_is_a_plane() {
    let scene = raster(10.0, 0.07, |x, y| 0.2 * x - 0.1 * y);
    for yaml in ROVERS {
        let stance =
            GroundContact::new(&rover(yaml), &scene, ContactSolver::GaussNewton).stand(4.0, 5.0, 0.0, None).unwrap();
        assert!((stance.pose.pitch_rad + math::atan(0.2)).abs() < 1e-9);
        assert!(stance.contact.residual_m < 1e-9);
    }
}

#[test]
fn law_a_rocker_bogie_touches_with_all_wheels_on_hills_and_rubble() {
    let rover = kapvik();
    let scenes = (0..10).map(hills).chain((0..10).map(|seed| rubble(seed, 0.01)));
    for (k, scene) in scenes.enumerate() {
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        for (x, y, yaw) in places(k as u64, scene.extent_m, 100) {
            let stance = contact.stand(x, y, yaw, None).unwrap();
            assert!(stance.contact.residual_m < 1e-6, "{k} {x} {y} {yaw}: {stance:?}");
        }
    }
}

/// A tolerance says how near the solution comes, and what it saves.
#[test]
fn order_coarser_tolerances_take_fewer_steps_and_stay_near_the_solution() {
    for solver in [ContactSolver::GaussNewton, ContactSolver::NelderMead] {
        let mut iterations = Vec::new();
        for tolerance in [None, Some(1e-6), Some(1e-4)] {
            let mut steps = 0;
            for (seed, yaml) in (0..4).flat_map(|seed| ROVERS.map(|yaml| (seed, yaml))) {
                let scene = hills(seed);
                let exact = GroundContact::new(&rover(yaml), &scene, ContactSolver::GaussNewton);
                let contact = GroundContact::new(&rover(yaml), &scene, solver).within(tolerance);
                for (x, y, yaw) in places(seed, scene.extent_m, 20) {
                    let (best, found) =
                        (exact.stand(x, y, yaw, None).unwrap(), contact.stand(x, y, yaw, None).unwrap());
                    steps += found.contact.iterations;
                    let off = (best.pose.position_m.z - found.pose.position_m.z)
                        .abs()
                        .max((best.pose.pitch_rad - found.pose.pitch_rad).abs())
                        .max((best.pose.roll_rad - found.pose.roll_rad).abs());
                    let bound = 100.0 * tolerance.unwrap_or(1e-8);
                    assert!(off <= bound, "{solver:?} {tolerance:?} {yaml}: {off}");
                }
            }
            iterations.push(steps);
        }
        assert!(iterations.is_sorted_by(|fine, coarse| fine >= coarse), "{solver:?}: {iterations:?}");
        assert!(iterations[2] < iterations[0], "{solver:?}: {iterations:?}");
    }
}

/// The contact equations written a second time, with the scene's own ground and whole matrices.
#[test]
fn equal_residuals_and_wheel_centres_by_whole_transforms() {
    let rover = kapvik();
    let linkage = Linkage::new(&rover);
    for seed in 0..5 {
        let scene = hills(seed);
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        for (x, y, yaw) in places(seed, 20.0, 20) {
            let ContactPose { pose, contact } = contact.stand(x, y, yaw, None).unwrap();
            let angles = [contact.rocker_rad, contact.bogie_left_rad, contact.bogie_right_rad];
            for centre in linkage.place(&angles).centres_m {
                let centre = pose.transform().point(centre);
                let rise = centre.z - scene.ground.height_m(centre.x, centre.y);
                let steep = scene.ground.gradient(centre.x, centre.y).length_squared();
                assert!((rise / (1.0 + steep).sqrt() - 0.05).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn exact_linkage_lengths_are_rigid() {
    let linkage = Linkage::new(&kapvik());
    let flat = linkage.place(&[0.0; 3]).centres_m;
    let bent = linkage.place(&[0.3, -0.2, 0.4]).centres_m;
    for (side, pivot_y) in [(0, 0.275), (3, -0.275)] {
        let pivot = DVec3::new(0.0, pivot_y, 0.2);
        assert!(((bent[side] - pivot).length() - (flat[side] - pivot).length()).abs() < 1e-14);
        assert!(
            ((bent[side + 1] - bent[side + 2]).length() - 0.3).abs() < 1e-14,
            "the bogie's wheels keep their distance"
        );
    }
    // Left rocker nose down: its rear wheel rises.
    assert!(bent[0].z > flat[0].z && bent[3].z < flat[3].z);
}

#[test]
fn equal_derivatives_and_central_differences() {
    for rover in [kapvik(), pioneer()] {
        let linkage = Linkage::new(&rover);
        for scene in [hills(3), rubble(3, 0.01)] {
            let surface = Surface::new(&scene);
            let problem = Problem::new(&linkage, &surface, 5.013, 4.021, 0.7);
            let ground = scene.ground.height_m(5.013, 4.021);
            let q: Unknowns = [ground + 0.01, 0.1, -0.15, 0.05, -0.1, 0.12];
            let (_, jacobian) = problem.linearised(&q, GroundDerivatives::Moving).unwrap();
            for i in 0..problem.unknowns() {
                // Small enough to stay in one raster cell.
                let moved = |by: f64| {
                    let mut q = q;
                    q[i] += by;
                    problem.residuals(&q).unwrap()
                };
                let (up, down) = (moved(1e-6), moved(-1e-6));
                for wheel in 0..linkage.wheel_count() {
                    let slope = (up[wheel] - down[wheel]) / 2e-6;
                    assert!((jacobian[wheel][i] - slope).abs() < 1e-8, "{wheel} {i}: {} {slope}", jacobian[wheel][i]);
                }
            }
        }
    }
}

#[test]
fn law_a_rigid_chassis_stands_where_its_least_squares_are_stationary() {
    let rover = pioneer();
    let linkage = Linkage::new(&rover);
    for seed in 0..20 {
        let scene = hills(seed);
        let surface = Surface::new(&scene);
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        for (x, y, yaw) in places(seed, 20.0, 20) {
            let stance = contact.stand(x, y, yaw, None).unwrap();
            let problem = Problem::new(&linkage, &surface, x, y, yaw);
            let (e, jacobian) = problem.linearised(&unknowns_of(&stance), GroundDerivatives::Moving).unwrap();
            for i in 0..3 {
                let gradient: f64 = e.iter().zip(&jacobian).map(|(e, row)| e * row[i]).sum();
                assert!(gradient.abs() < 1e-12, "{seed} {i}: {gradient:e} {stance:?}");
            }
        }
    }
}

#[test]
fn order_no_stand_nearby_is_better_than_a_rigid_rovers_on_rubble() {
    let rover = pioneer();
    let linkage = Linkage::new(&rover);
    for seed in 0..5 {
        let scene = rubble(seed, 0.01);
        let surface = Surface::new(&scene);
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        for (x, y, yaw) in places(seed, 10.0, 20) {
            let stance = contact.stand(x, y, yaw, None).unwrap();
            let problem = Problem::new(&linkage, &surface, x, y, yaw);
            let q = unknowns_of(&stance);
            let least = sum_of_squares(&problem.residuals(&q).unwrap());
            let draws = streams(seed).open(Purpose::StartHeading);
            for k in 0..50 {
                let near: Unknowns =
                    std::array::from_fn(|i| if i < 3 { q[i] + 1e-4 * draws.normal(3 * k + i as u64) } else { 0.0 });
                assert!(problem.cost(&near).unwrap() > least - 1e-9, "{seed} {x} {y} {yaw}");
            }
        }
    }
}

#[test]
fn equal_gauss_newton_and_nelder_mead() {
    for yaml in ROVERS {
        let rover = rover(yaml);
        for seed in 0..4 {
            let scene = hills(100 + seed);
            let newton = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
            let simplex = GroundContact::new(&rover, &scene, ContactSolver::NelderMead);
            for (x, y, yaw) in places(seed, 20.0, 8) {
                let (a, b) = (newton.stand(x, y, yaw, None).unwrap(), simplex.stand(x, y, yaw, None).unwrap());
                let off =
                    unknowns_of(&a).iter().zip(unknowns_of(&b)).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
                assert!(off < 1e-6, "{} {seed}: {off:e}\n{a:?}\n{b:?}", rover.name);
            }
        }
    }
}

#[test]
fn equal_warm_and_cold_starts() {
    for yaml in ROVERS {
        let rover = rover(yaml);
        for scene in [hills(7), hills(8)] {
            let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
            let mut before = contact.stand(4.0, 6.0, 0.4, None).unwrap();
            for k in 1..100 {
                let (x, y, yaw) = (4.0 + 0.05 * f64::from(k), 6.0 + 0.02 * f64::from(k), 0.4 + 0.01 * f64::from(k));
                let warm = contact.stand(x, y, yaw, Some(&before)).unwrap();
                let cold = contact.stand(x, y, yaw, None).unwrap();
                let off =
                    unknowns_of(&warm).iter().zip(unknowns_of(&cold)).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
                assert!(off < 1e-9, "{} {k}: {off:e}", rover.name);
                assert!(warm.contact.iterations <= 8, "{} {k}: {warm:?}", rover.name);
                before = warm;
            }
        }
    }
}

#[test]
fn golden_nelder_mead_takes_scipys_steps() {
    // scipy 1.x optimize.minimize(method="Nelder-Mead") from the same first simplex: evaluations and best vertex after 10
    // and 40 iterations.
    let rosenbrock = |x: &[f64; 2]| {
        let (a, b) = (x[1] - x[0] * x[0], 1.0 - x[0]);
        100.0 * a * a + b * b
    };
    let powell = |x: &[f64; 4]| {
        let (a, b, c, d) = (x[0] + 10.0 * x[1], x[2] - x[3], x[1] - 2.0 * x[2], x[0] - x[3]);
        a * a + 5.0 * b * b + c * c * c * c + 10.0 * d * d * d * d
    };
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-11);
    for (evaluations, at) in [
        (20, [-0.9828124999999996, 0.9695312500000006]),
        (68, [0.0885814666748158, 0.0020296096801685065]),
        (250, [1.0000000000579297, 1.0000000001137883]),
    ] {
        let found = minimise(rosenbrock, [-1.2, 1.0], [0.1; 2], 1e-9, 1e-16, evaluations);
        assert_eq!(found.evaluations, evaluations);
        assert!(near(&found.at, &at), "{found:?}");
    }
    for (evaluations, at) in [
        (20, [1.359375, -0.033203125, 0.568359375, 1.498046875]),
        (73, [0.2262403589467299, -0.013171773501634232, 0.10563401333596495, 0.14564612296556867]),
    ] {
        let found = minimise(powell, [3.0, -1.0, 0.0, 1.0], [0.5; 4], 1e-9, 1e-16, evaluations);
        assert_eq!(found.evaluations, evaluations);
        assert!(near(&found.at, &at), "{found:?}");
    }
}

#[test]
fn extreme_steep_and_broken_ground_gives_a_stand_or_says_why_not() {
    let tilt = |degrees: f64| math::tan(degrees.to_radians());
    let mut bent = vec![0.0; crate::scene::polynomial::term_count(2)];
    bent[4] = 8.0;
    let grounds: [(&str, Scene); 8] = [
        ("45 degrees", plane(8.0, 0.0, DVec2::new(tilt(45.0), 0.0))),
        ("59 degrees", plane(8.0, 0.0, DVec2::new(0.0, tilt(59.0)))),
        ("saddle", Scene::bare(8.0, Ground::Polynomial(Polynomial::new(8.0, 2, bent)))),
        ("ridge under one side", raster(8.0, 0.05, |_, y| 0.15 * math::exp(-(y - 4.25) * (y - 4.25) / 0.01))),
        ("step across", raster(8.0, 0.05, |x, _| if x < 4.1 { 0.0 } else { 0.12 })),
        ("step along", raster(8.0, 0.05, |_, y| if y < 4.0 { 0.0 } else { 0.2 })),
        ("cliff", raster(8.0, 0.05, |x, _| if x < 4.1 { 0.0 } else { 3.0 })),
        ("not a number", raster(8.0, 0.05, |x, _| if x < 4.1 { 0.0 } else { f64::NAN })),
    ];
    for (name, scene) in &grounds {
        for yaml in ROVERS {
            let rover = rover(yaml);
            for solver in SOLVERS {
                let contact = GroundContact::new(&rover, scene, solver);
                for k in 0..16 {
                    let yaw = math::wrap_angle(0.1 + f64::from(k) * 0.4);
                    match contact.stand(4.0, 4.0, yaw, None) {
                        Ok(stance) => {
                            assert!(
                                unknowns_of(&stance).iter().all(|v| v.is_finite()),
                                "{name} {solver:?}: {stance:?}"
                            );
                            let exact = unknown_count(&rover) == UNKNOWNS && solver != ContactSolver::PlaneFit;
                            assert!(!exact || stance.contact.residual_m < 1e-6, "{name} {solver:?}: {stance:?}");
                        }
                        Err(DriveError::NoContact { reason, .. }) => {
                            assert!(!name.ends_with("degrees"), "{name} {solver:?} {yaw}: {reason}");
                        }
                        Err(other) => panic!("{name}: {other}"),
                    }
                }
            }
        }
    }
}

#[test]
fn extreme_wheels_over_the_yards_edge_are_refused() {
    let scene = plane(8.0, 0.0, DVec2::ZERO);
    for yaml in ROVERS {
        let rover = rover(yaml);
        for solver in SOLVERS {
            let contact = GroundContact::new(&rover, &scene, solver);
            for (x, y) in [(0.1, 4.0), (4.0, 7.95), (-1.0, 4.0), (f64::NAN, 4.0), (4.0, f64::INFINITY)] {
                assert!(matches!(contact.stand(x, y, 0.3, None), Err(DriveError::NoContact { .. })), "{x} {y}");
            }
            // A stance that is already close does not help.
            let inside = contact.stand(1.0, 4.0, 0.3, None).unwrap();
            assert!(contact.stand(0.05, 4.0, 0.3, Some(&inside)).is_err());
        }
    }
}

#[test]
fn extreme_beyond_sixty_degrees_the_rover_tips_over() {
    let scene = plane(8.0, 0.0, DVec2::new(1.8, 0.0));
    let error =
        GroundContact::new(&kapvik(), &scene, ContactSolver::GaussNewton).stand(4.0, 4.0, 0.0, None).unwrap_err();
    assert!(error.to_string().contains("tip over"), "{error}");
}
