//! Contact at its extremes, beside what a textbook gives there: the slope under the chassis, a plane through three wheels, wheels
//! measured straight down, a polynomial that goes on beyond its yard.
//!
//! Expected stands: closed forms of rigid chassis, symmetry, and the contact equations themselves.

use super::*;
use crate::drive::rover::Chassis;
use crate::extremes::{Family, row};

/// The four-wheeled rovers with their wheelbase and track, metres.
fn rigid_rovers() -> impl Iterator<Item = (Rover, f64, f64)> {
    ROVERS.iter().map(|yaml| rover(yaml)).filter_map(|rover| match &rover.chassis {
        Chassis::Rigid(chassis) => {
            let (wheelbase_m, track_m) = (chassis.wheelbase_m, chassis.track_m);
            Some((rover, wheelbase_m, track_m))
        }
        Chassis::RockerBogie(_) => None,
    })
}

/// Pitch and roll of the plane through the ground under three wheels: front left, front right, rear left.
fn by_three_wheels(scene: &Scene, wheelbase_m: f64, track_m: f64, at: DVec2) -> (f64, f64) {
    let z = |x: f64, y: f64| scene.ground.height_m(at.x + x, at.y + y);
    let (x, y) = (0.5 * wheelbase_m, 0.5 * track_m);
    (-math::atan((z(x, y) - z(-x, y)) / wheelbase_m), math::atan((z(x, y) - z(x, -y)) / track_m))
}

#[test]
fn extreme_a_saddle_holds_a_rover_level() {
    // z = k u v about the middle of the yard: half a turn about the vertical changes nothing, so pitch and roll are 0.
    let mut bent = vec![0.0; crate::scene::polynomial::term_count(2)];
    bent[4] = 8.0;
    let scene = Scene::bare(8.0, Ground::Polynomial(Polynomial::new(8.0, 2, bent)));
    let middle = DVec2::splat(4.0);
    for (rover, wheelbase_m, track_m) in rigid_rovers() {
        let mut worst = 0.0_f64;
        for solver in SOLVERS {
            let contact = GroundContact::new(&rover, &scene, solver);
            for yaw in [0.0, 0.4, std::f64::consts::FRAC_PI_4, 2.0] {
                let stance = contact.stand(4.0, 4.0, yaw, None).unwrap();
                worst = worst.max(stance.pose.pitch_rad.abs()).max(stance.pose.roll_rad.abs());
            }
            // Along the axes of the saddle diagonal wheels share the error, with alternating signs.
            let stance = contact.stand(4.0, 4.0, 0.0, None).unwrap();
            let [a, b, c, d] = contact.residuals_m(&stance).unwrap()[..] else { panic!("four wheels") };
            assert!((a - d).abs() < 1e-6 && (b - c).abs() < 1e-6 && a * b < 0.0, "{solver:?}: {a} {b} {c} {d}");
        }
        assert!(worst < 1e-6, "{}: {worst:e}", rover.name);
        let (pitch, roll) = by_three_wheels(&scene, wheelbase_m, track_m, middle);
        assert!(pitch.abs().max(roll.abs()) > 0.01);
        row(
            Family::Contact,
            &format!("saddle, {}", rover.name),
            &format!("plane through three wheels: {:.1} deg off level", pitch.abs().max(roll.abs()).to_degrees()),
            &format!("level to {worst:.0e} rad, by all three solvers"),
        );
    }
    // z = k (u^2 - v^2): its two sides are mirror images, so a rocker-bogie does not roll and its bogies agree.
    let mut ridge_and_valley = vec![0.0; crate::scene::polynomial::term_count(2)];
    (ridge_and_valley[2], ridge_and_valley[5]) = (-0.6, 0.6);
    let scene = Scene::bare(8.0, Ground::Polynomial(Polynomial::new(8.0, 2, ridge_and_valley)));
    let stance = GroundContact::new(&kapvik(), &scene, ContactSolver::GaussNewton).stand(4.0, 4.0, 0.0, None).unwrap();
    let contact = stance.contact;
    assert!(stance.pose.roll_rad.abs() < 1e-9 && contact.rocker_rad.abs() < 1e-9 && contact.residual_m < 1e-9);
    assert!((contact.bogie_left_rad - contact.bogie_right_rad).abs() < 1e-9 && contact.bogie_left_rad.abs() > 1e-3);
}

#[test]
fn extreme_a_ridge_under_one_wheel() {
    let height_m = 0.01;
    for (rover, wheelbase_m, track_m) in rigid_rovers() {
        let (x, y) = (4.0 + 0.5 * wheelbase_m, 4.0 + 0.5 * track_m);
        // A ridge along x under the front left wheel, flat on top.
        let on = |at: f64, place: f64| (at - place).abs() <= 0.0801;
        let scene = raster(8.0, 0.02, |px, py| if on(px, x) && on(py, y) { height_m } else { 0.0 });
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        let stance = contact.stand(4.0, 4.0, 0.0, None).unwrap();
        // Four wheels on a rectangle: the least squares leave a quarter of the odd height to each, signs alternating.
        let residuals = contact.residuals_m(&stance).unwrap();
        let share = residuals.iter().map(|e| (e.abs() / (0.25 * height_m) - 1.0).abs()).fold(0.0, f64::max);
        assert!(share < 0.01, "{}: {residuals:?}", rover.name);
        // By hand: each pair's mean heights differ by h / 2 along and across.
        let (pitch, roll) = (-math::atan(0.5 * height_m / wheelbase_m), math::atan(0.5 * height_m / track_m));
        assert!(
            (stance.pose.pitch_rad - pitch).abs() < 1e-3 && (stance.pose.roll_rad - roll).abs() < 1e-3,
            "{stance:?}"
        );
        let (of_three, _) = by_three_wheels(&scene, wheelbase_m, track_m, DVec2::splat(4.0));
        row(
            Family::Contact,
            &format!("ridge of 1 cm under one wheel, {}", rover.name),
            &format!(
                "plane through three wheels: pitch {:.2} deg off, the fourth wheel {:.1} mm in the ground",
                (of_three - pitch).abs().to_degrees(),
                1e3 * height_m
            ),
            &format!("2.5 mm at each wheel, to {:.1} %; pitch and roll as by hand", 100.0 * share),
        );
    }
    // Six wheels and six unknowns: all touch, the contact equations asked again.
    let rover = kapvik();
    let place = Linkage::new(&rover).place(&[0.0; 3]).centres_m[1];
    let scene = raster(8.0, 0.02, |_, py| 0.05 * math::exp(-(py - 4.0 - place.y) * (py - 4.0 - place.y) / 0.02));
    let mut worst = 0.0_f64;
    for yaw in [0.0, 0.1, -0.3] {
        let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
        let stance = contact.stand(4.0, 4.0, yaw, None).unwrap();
        worst = contact.residuals_m(&stance).unwrap().iter().fold(worst, |worst, e| worst.max(e.abs()));
    }
    assert!(worst < 1e-6, "{worst:e}");
    row(
        Family::Contact,
        "ridge of 5 cm under the wheels of one side, kapvik",
        "slope under the chassis: 0 deg, wheels of one side 50 mm in the ground",
        &format!("all six wheels touch, to {worst:.0e} m"),
    );
}

#[test]
fn extreme_a_step_between_the_wheels() {
    let height_m = 0.08;
    // The step rises within one raster cell, just ahead of the middle.
    let scene = raster(8.0, 0.02, |x, _| if x < 4.0 { 0.0 } else { height_m });
    for (rover, wheelbase_m, _) in rigid_rovers() {
        // Both axles on level ground: the line of their centres climbs the step.
        let pitch = -math::asin(height_m / wheelbase_m);
        let mut worst = 0.0_f64;
        for solver in [ContactSolver::GaussNewton, ContactSolver::NelderMead] {
            let stance = GroundContact::new(&rover, &scene, solver).stand(3.99, 4.0, 0.0, None).unwrap();
            worst = worst.max((stance.pose.pitch_rad - pitch).abs()).max(stance.contact.residual_m);
        }
        assert!(worst < 1e-6, "{}: {worst:e}", rover.name);
        let local = -math::atan(scene.ground.gradient(3.99, 4.0).x);
        assert!((local - pitch).abs() > 0.1);
        row(
            Family::Contact,
            &format!("step of 8 cm between the axles, {}", rover.name),
            &format!("slope under the chassis: pitch {:.0} deg off", (local - pitch).abs().to_degrees()),
            &format!("asin(step / wheelbase) to {worst:.0e} rad"),
        );
    }
    let rover = kapvik();
    let contact = GroundContact::new(&rover, &scene, ContactSolver::GaussNewton);
    let stance = contact.stand(3.85, 4.0, 0.0, None).unwrap();
    let worst = contact.residuals_m(&stance).unwrap().iter().fold(0.0_f64, |worst, e| worst.max(e.abs()));
    assert!(worst < 1e-6 && stance.contact.rocker_rad.abs() < 1e-9, "{stance:?}");
    row(
        Family::Contact,
        "step of 8 cm between the bogie's wheels, kapvik",
        &format!(
            "slope under the chassis: pitch {:.0} deg, with the front wheels 8 cm up",
            math::atan(scene.ground.gradient(3.85, 4.0).x).to_degrees()
        ),
        &format!("all six wheels touch, to {worst:.0e} m"),
    );
}

#[test]
fn extreme_slopes_of_45_degrees_under_every_rover() {
    let scene = plane(20.0, 0.0, DVec2::new(1.0, 0.0));
    for yaml in ROVERS {
        let rover = rover(yaml);
        let mut worst = 0.0_f64;
        for solver in SOLVERS {
            let contact = GroundContact::new(&rover, &scene, solver);
            for k in 0..16 {
                let yaw = math::wrap_angle(0.1 + 0.4 * f64::from(k));
                let stance = contact.stand(10.0, 10.0, yaw, None).unwrap();
                let up = DVec3::new(-1.0, 0.0, 1.0).normalize();
                worst = worst.max((stance.pose.rotation().z_axis - up).length()).max(stance.contact.residual_m);
                worst = worst.max((stance.pose.position_m.z - 10.0).abs());
            }
        }
        assert!(worst < 1e-8, "{}: {worst:e}", rover.name);
        // A wheel set one radius above the ground straight below its centre.
        let radius_m = rover.wheel_radius_m();
        let depth_m = radius_m * (1.0 - std::f64::consts::FRAC_1_SQRT_2);
        row(
            Family::Contact,
            &format!("slope of 45 degrees, {}", rover.name),
            &format!("wheels measured straight down: {:.1} mm in the ground", 1e3 * depth_m),
            &format!("on the plane at 16 headings by all solvers, to {worst:.0e} m and rad"),
        );
    }
}

#[test]
fn extreme_a_wheel_over_the_yards_edge() {
    let mut coefficients = vec![0.0; crate::scene::polynomial::term_count(12)];
    coefficients[12] = 0.05;
    let ground = Polynomial::new(8.0, 12, coefficients);
    let invented_m = ground.height_m(4.0, 8.8);
    let inside_m = (0..=80).map(|k| ground.height_m(4.0, 0.1 * f64::from(k)).abs()).fold(0.0, f64::max);
    let scene = Scene::bare(8.0, Ground::Polynomial(ground));
    for yaml in ROVERS {
        for solver in SOLVERS {
            let refused = GroundContact::new(&rover(yaml), &scene, solver).stand(4.0, 7.95, 0.3, None).unwrap_err();
            assert!(refused.to_string().contains("outside the yard"), "{refused}");
        }
    }
    assert!(invented_m.abs() > inside_m);
    row(
        Family::Contact,
        "a wheel over the yard's edge",
        &format!("the fit goes on: {invented_m:.2} m at 0.8 m outside, {inside_m:.2} m at most inside"),
        "refused: a wheel is outside the yard",
    );
}
