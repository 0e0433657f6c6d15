//! The reference's own drives -> the surrogate that errs as much as its pose estimate.
//!
//! In: a plan and some of its scenes. Out: root mean squares of what the estimates at kept scans err: in x and y, in z, in roll and pitch, in
//! heading, over all families whose pose is estimated. So the corpora of the setting `surrogate`, and those that `plan --hours` recommends by it,
//! have poses as good as the filter's, and not as good as a default says. Not modelled: that errors of the axes hang together, and those of stops
//! one after another (two sweeps of a window lie farther apart than the filter lays them); that they are the larger the longer the
//! drive, and the sigmas with them; tails.

use std::sync::atomic::AtomicBool;

use super::measure::axis_errors;
use super::{TradeoffError, caught};
use crate::episode::{Prepared, Scratch, Unobserved, replay_scene};
use crate::parallel;
use crate::plan::Plan;
use crate::slam::SlamParams;
use crate::slam::params::SurrogateParams;

/// So many scenes tell a root mean square of one axis to some 9 percent, of two to 6.
const ENOUGH_SCENES: usize = 60;
/// The greatest values that a config may hold: metres, degrees of tilt, of heading.
const MOST: [f64; 3] = [10.0, 45.0, 180.0];

/// As the plan's estimates err at the first of these scenes; the plan's own where it draws its errors; the default where it knows the truth, or no
/// scene can be made. `None` where `stop` was raised.
pub(super) fn calibrated(
    plan: &Plan,
    scenes: &[u64],
    threads: usize,
    stop: &AtomicBool,
) -> Result<Option<SurrogateParams>, TradeoffError> {
    let own = plan.families.iter().find_map(|family| match &family.slam {
        SlamParams::Surrogate(own) => Some(own.clone()),
        _ => None,
    });
    if own.is_some() || plan.families.iter().all(|family| family.slam == SlamParams::Truth) {
        return Ok(Some(own.unwrap_or_default()));
    }
    Ok(errors(plan, scenes, threads, stop)?.map(|errors| of_errors(&errors)))
}

/// At the kept scans of the first of these scenes.
fn errors(
    plan: &Plan,
    scenes: &[u64],
    threads: usize,
    stop: &AtomicBool,
) -> Result<Option<Vec<[f64; 6]>>, TradeoffError> {
    let prepared = Prepared::new(plan.clone())?;
    let scenes: Vec<u64> = scenes.iter().copied().take(ENOUGH_SCENES).collect();
    let one_scene = |scene: u64, scratch: &mut Scratch| caught(|| errors_of(&prepared, scene, scratch));
    let made = parallel::map(threads, scenes, stop, one_scene, |_| ())?;
    Ok(made.map(|errors| errors.concat()))
}

/// At the kept scans of a scene; none of one that cannot be made, for measuring tells why.
fn errors_of(prepared: &Prepared, scene: u64, scratch: &mut Scratch) -> Vec<[f64; 6]> {
    let Ok(replay) = replay_scene(prepared, scene, scratch, &mut Unobserved) else { return Vec::new() };
    let is_estimated = prepared.plan.families[replay.family].slam != SlamParams::Truth;
    let kept = replay.poses.iter().filter(|pose| is_estimated && pose.scan_id.is_some());
    let errors = kept.map(|pose| axis_errors(&pose.truth, &pose.estimate));
    errors.filter(|error| error.iter().all(|axis| axis.is_finite())).collect()
}

fn of_errors(errors: &[[f64; 6]]) -> SurrogateParams {
    if errors.is_empty() {
        return SurrogateParams::default();
    }
    let root_mean_square = |axes: &[usize]| {
        let squares: f64 = errors.iter().flat_map(|error| axes.iter().map(|&axis| error[axis] * error[axis])).sum();
        (squares / (errors.len() * axes.len()) as f64).sqrt()
    };
    // Digits beyond these are of the scenes that were drawn.
    let rounded = |value: f64, most: f64, unit: f64| ((value / unit).round() * unit).min(most);
    let [metres, tilt_deg, heading_deg] = MOST;
    SurrogateParams {
        xy_m: rounded(root_mean_square(&[0, 1]), metres, 1e-4),
        z_m: rounded(root_mean_square(&[2]), metres, 1e-4),
        tilt_deg: rounded(root_mean_square(&[3, 4]).to_degrees(), tilt_deg, 1e-3),
        yaw_deg: rounded(root_mean_square(&[5]).to_degrees(), heading_deg, 1e-3),
    }
}

/// As `--set slam=` takes it.
pub(super) fn written(params: &SurrogateParams) -> String {
    let SurrogateParams { xy_m, z_m, tilt_deg, yaw_deg } = params;
    format!("{{surrogate: {{xy_m: {xy_m:.4}, z_m: {z_m:.4}, tilt_deg: {tilt_deg:.3}, yaw_deg: {yaw_deg:.3}}}}}")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::config;

    fn plan_of(slam: &str) -> Plan {
        let sets = [format!("slam={slam}"), "sweep.sensor.pattern.tilted.beams=61".into()];
        config::load(Path::new("configs/paper.yaml"), &sets).unwrap()
    }

    #[test]
    fn dist_a_surrogate_is_found_again_by_its_own_errors() {
        let sigmas = |p: &SurrogateParams| [p.xy_m, p.z_m, p.tilt_deg, p.yaw_deg];
        let given = SurrogateParams { xy_m: 0.08, z_m: 0.01, tilt_deg: 1.2, yaw_deg: 3.0 };
        let scenes: Vec<u64> = (0..200).collect();
        let errors = errors(&plan_of(&written(&given)), &scenes, 2, &AtomicBool::new(false)).unwrap().unwrap();
        assert_eq!(errors.len(), ENOUGH_SCENES, "one kept scan a scene");
        let found = of_errors(&errors);
        // 60 numbers or 120: a relative standard deviation of 0.09 and 0.065; three of them.
        for ((found, given), bound) in sigmas(&found).into_iter().zip(sigmas(&given)).zip([0.2, 0.28, 0.2, 0.28]) {
            assert!((found / given - 1.0).abs() < bound, "{found} of {given}");
        }
    }

    #[test]
    fn exact_roots_of_mean_squares_by_axis() {
        let rad = |deg: f64| deg.to_radians();
        let errors = [[0.3, 0.4, 0.02, rad(1.0), rad(-7.0), rad(2.0)], [0.0, 0.0, -0.02, 0.0, 0.0, rad(-4.0)]];
        let expected = SurrogateParams { xy_m: 0.25, z_m: 0.02, tilt_deg: 3.536, yaw_deg: 3.162 };
        let found = of_errors(&errors);
        for (a, b) in [
            (found.xy_m, expected.xy_m),
            (found.z_m, expected.z_m),
            (found.tilt_deg, expected.tilt_deg),
            (found.yaw_deg, expected.yaw_deg),
        ] {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        assert_eq!(written(&found), "{surrogate: {xy_m: 0.2500, z_m: 0.0200, tilt_deg: 3.536, yaw_deg: 3.162}}");
    }

    #[test]
    fn extreme_poses_that_are_known_or_drawn_already_no_scan_and_errors_beyond_a_config() {
        let calibrated = |slam: &str| calibrated(&plan_of(slam), &[0], 1, &AtomicBool::new(false)).unwrap().unwrap();
        assert_eq!(calibrated("truth"), SurrogateParams::default());
        let own = SurrogateParams { xy_m: 0.07, ..SurrogateParams::default() };
        assert_eq!(calibrated(&written(&own)), own);
        assert_eq!(of_errors(&[]), SurrogateParams::default());
        let far = of_errors(&[[1e9; 6]]);
        assert_eq!([far.xy_m, far.z_m, far.tilt_deg, far.yaw_deg], [10.0, 10.0, 45.0, 180.0]);
    }
}
