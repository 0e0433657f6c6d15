//! `localise --sweeps`: a simulated drive written down as a recording, with nothing but points of its sweeps, is located as a build locates it.

use std::fmt::Write as _;

use marsyard::cloud::trajectory;
use marsyard::config;
use marsyard::drive::InstrumentNoise;
use marsyard::episode::{Prepared, Replay, Scratch, Unobserved, replay_scene};
use marsyard::geometry::Pose;
use marsyard::random::Stage;
use marsyard::slam::{FastslamParams, Slam, SlamParams};
use marsyard::sweep::{self, Caster, Returns, Status};
use serde_json::Value as Json;

use crate::yard::{Yard, text};

/// A drive of paper.yaml that goes on for 10 m, with a stop each half metre.
struct Drive {
    prepared: Prepared,
    replay: Replay,
    scene: u64,
    noise: InstrumentNoise,
}

impl Drive {
    fn of(scene: u64) -> Drive {
        let paper = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/paper.yaml");
        let path = "drive.path={planned: {goal_m: 10}}";
        let sets = ["slam=truth", path, "drive.stops=20", "drive.turn_as_way_m_per_rad=0"].map(String::from);
        let prepared = Prepared::new(config::load(&paper, &sets).expect("a plan")).expect("beams");
        let replay = replay_scene(&prepared, scene, &mut Scratch::default(), &mut Unobserved).expect("a drive");
        let noise = InstrumentNoise::of(&prepared.plan.families[replay.family].drive.instruments, &replay.drawn);
        Drive { prepared, replay, scene, noise }
    }

    fn returns(&self, step: usize, stop: usize) -> Returns {
        let Replay { scene, drive, drawn, rover_from_sensor, attempts, family, .. } = &self.replay;
        let world_from_sensor = drive.truth[step].transform() * *rover_from_sensor;
        let params = &self.prepared.plan.families[*family].sweep;
        let streams = self.prepared.plan.streams(self.scene, attempts - 1, Stage::Sweep).at_step(stop as u32);
        let (caster, mut memory) = (Caster::new(scene, &params.cast), sweep::Scratch::default());
        let pattern = self.prepared.pattern(*family);
        sweep::sweep(params, pattern, &caster, &world_from_sensor, drawn, &streams, &mut memory)
            .expect("a sweep")
            .returns
    }

    fn last(&self) -> usize {
        *self.replay.drive.stops.last().expect("a stop")
    }

    /// Where the filter of a build believes to be at the last stop, with whole sweeps, by 100 particles.
    fn located(&self) -> Pose {
        let Replay { drive, rover_from_sensor, .. } = &self.replay;
        let mut slam =
            Slam::new(&SlamParams::default(), &self.noise, &drive.truth[0], rover_from_sensor).expect("a filter");
        for (step, reading) in drive.readings[..=self.last()].iter().enumerate() {
            slam.step(reading).expect("a step");
            if let Some(stop) = drive.stops.iter().position(|&at| at == step) {
                let streams = self.prepared.plan.streams(self.scene, 0, Stage::Slam).at_step(step as u32);
                slam.observe(&self.returns(step, stop), &streams).expect("an estimate");
            }
        }
        slam.estimate().pose
    }

    /// Writes odometry.csv, truth.csv, sweeps.csv and the points of each sweep, in the order of the beams.
    fn record(&self, yard: &Yard) {
        let Replay { drive, .. } = &self.replay;
        let mut odometry = String::from("time_s,speed_mps,yaw_rate_radps,roll_rad,pitch_rad,yaw_rad\n");
        let (mut truth, mut list) =
            (String::from("time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad\n"), String::from("time_s,file\n"));
        std::fs::create_dir(yard.path("scans")).expect("a folder");
        let mut time_s = 0.0;
        for (step, reading) in drive.readings[..=self.last()].iter().enumerate() {
            time_s += reading.dt_s;
            let angle = |angle: Option<f64>| angle.map_or(String::new(), |angle| angle.to_string());
            let [roll, pitch, yaw] = [reading.roll_rad, reading.pitch_rad, reading.yaw_rad].map(angle);
            writeln!(odometry, "{time_s},{},{},{roll},{pitch},{yaw}", reading.speed_mps, reading.yaw_rate_radps)
                .unwrap();
            let Pose { position_m: p, roll_rad, pitch_rad, yaw_rad } = drive.truth[step];
            writeln!(truth, "{time_s},{},{},{},{roll_rad},{pitch_rad},{yaw_rad}", p.x, p.y, p.z).unwrap();
            if let Some(stop) = drive.stops.iter().position(|&at| at == step) {
                let returns = self.returns(step, stop);
                let mut points = String::from("x,y,z\n");
                for ((direction, range_m), status) in
                    returns.pattern.directions.iter().zip(&returns.range_m).zip(&returns.status)
                {
                    if *status == Status::Hit {
                        let p = *direction * *range_m;
                        writeln!(points, "{},{},{}", p.x, p.y, p.z).unwrap();
                    }
                }
                std::fs::write(yard.path(&format!("scans/{stop:03}.csv")), points).expect("a file");
                writeln!(list, "{time_s},scans/{stop:03}.csv").unwrap();
            }
        }
        for (name, text) in [("odometry.csv", odometry), ("truth.csv", truth), ("sweeps.csv", list)] {
            std::fs::write(yard.path(name), text).expect("a file");
        }
    }

    /// The options that tell what the drive's instruments are, and where the sensor sits.
    fn options(&self) -> Vec<String> {
        let mount = Pose::from_transform(&self.replay.rover_from_sensor);
        let (p, [yaw, pitch, roll]) =
            (mount.position_m, [mount.yaw_rad, mount.pitch_rad, mount.roll_rad].map(f64::to_degrees));
        let noise = &self.noise;
        vec![
            format!("--sensor={},{},{},{yaw},{pitch},{roll}", p.x, p.y, p.z),
            format!("--imu-deg={}", noise.imu_rad.to_degrees()),
            format!("--imu-bias-deg={}", noise.imu_bias_rad.to_degrees()),
            format!("--sun-deg={}", noise.sun_rad.to_degrees()),
            format!("--odometry-m-per-sqrt-m={}", noise.odometry_m_per_sqrt_m),
            format!("--odometry-deg-per-sqrt-m={}", noise.heading_rad_per_sqrt_m.to_degrees()),
            "--sideways-m-per-sqrt-m=0".into(),
            "--particles=100".into(),
            format!("--feature-range-m={}", FastslamParams::default().feature_range_m),
        ]
    }
}

fn localise(yard: &Yard, drive: &Drive, extra: &[&str]) -> Json {
    let mut arguments = vec!["localise", "odometry.csv", "--sweeps", "sweeps.csv", "--truth", "truth.csv", "--json"];
    let options = drive.options();
    // Registration has no particles.
    let is_taken = |option: &&String| !(extra.contains(&"--registration") && option.starts_with("--particles"));
    arguments.extend(options.iter().filter(is_taken).map(String::as_str));
    arguments.extend(extra);
    let output = yard.marsyard(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn law_points_of_sweeps_locate_a_drive_as_whole_sweeps_do() {
    let number = |said: &Json, of: &str| said[of]["last_error_m"].as_f64().expect("a number");
    let (mut of_points_m, mut of_sweeps_m, mut reckoned_m, mut registered_m) = (0.0, 0.0, 0.0, 0.0);
    for scene in 0..12 {
        let (yard, drive) = (Yard::new(), Drive::of(scene));
        drive.record(&yard);
        let said = localise(&yard, &drive, &[]);
        of_points_m += number(&said, "score");
        reckoned_m += number(&said, "dead_reckoning");
        let off_m = drive.located().position_m - drive.replay.drive.truth[drive.last()].position_m;
        of_sweeps_m += off_m.truncate().length();
        let registered = localise(&yard, &drive, &["--registration", "--out", "registered"]);
        registered_m += number(&registered, "score");
        assert!(registered["sweeps"]["found_again"].as_u64() > Some(0), "{registered}");
        // Each sweep has a row, at the sweep's time, so that `classify --trajectory` finds one for each cloud.
        let trajectory = std::fs::read_to_string(yard.path("located/sweeps.tum")).expect("a file");
        let poses = trajectory::parse("sweeps.tum", &trajectory).expect("poses");
        assert_eq!(said["sweeps"]["listed"], poses.len(), "{said}");
        let names: Vec<String> = (0..poses.len()).map(|stop| format!("{stop:03}")).collect();
        assert_eq!(trajectory::match_clouds("sweeps.tum", &poses, &names, 1e-6).expect("as many").len(), names.len());
    }
    let all_m = [of_points_m, of_sweeps_m, reckoned_m];
    println!("errors at the end, m: of points, of whole sweeps, reckoned {all_m:?}; registration alone {registered_m}");
    assert!(of_points_m < 0.6 * reckoned_m && of_sweeps_m < 0.6 * reckoned_m, "{all_m:?}");
    assert!((of_points_m / of_sweeps_m - 1.0).abs() < 0.25, "{all_m:?}");
    assert!(registered_m < 0.6 * reckoned_m, "{registered_m} {all_m:?}");
}

#[test]
fn law_points_at_the_sensor_and_on_the_rover_are_left_out_and_counted() {
    let (yard, drive) = (Yard::new(), Drive::of(1));
    drive.record(&yard);
    let clean = localise(&yard, &drive, &["--out", "clean"]);
    let sensor = drive.replay.rover_from_sensor;
    let mut added = 0;
    for entry in std::fs::read_dir(yard.path("scans")).expect("a folder") {
        let path = entry.expect("an entry").path();
        let points = std::fs::read_to_string(&path).expect("a file");
        // A mast of points on the rover, which every sweep sees in the same place; and what drivers write of beams without a return.
        let mast: String = (0..40)
            .map(|k| sensor.inverse().point(marsyard::geometry::DVec3::new(-0.1, 0.0, 0.15 + 0.005 * f64::from(k))))
            .map(|p| format!("{},{},{}\n", p.x, p.y, p.z))
            .collect();
        std::fs::write(&path, format!("{points}{mast}0,0,0\nnan,1,1\n")).expect("a file");
        added += 1;
    }
    let with_mast = localise(&yard, &drive, &["--out", "filtered", "--self-filter", "0.5,0.5,0.4"]);
    let sweeps = &with_mast["sweeps"];
    assert_eq!((&sweeps["on_rover"], &sweeps["at_sensor"]), (&Json::from(40 * added), &Json::from(added)), "{sweeps}");
    assert_eq!(sweeps["not_finite"], added, "{sweeps}");
    assert_eq!(sweeps["points"].as_u64(), clean["sweeps"]["points"].as_u64().map(|points| points + 42 * added));
    assert_eq!(with_mast["score"], clean["score"], "what is left out changes nothing");
}

#[test]
fn extreme_sweeps_in_which_nothing_is_found_again_are_dead_reckoning_and_told() {
    let yard = Yard::new();
    let write = |name: &str, text: &str| std::fs::write(yard.path(name), text).expect("a file");
    write("o.csv", "time_s,speed_mps,yaw_rate_radps\n0,0,0\n1,1,0\n2,1,0\n");
    let whole = yard.path("far.xyz");
    write("s.csv", &format!("time_s,file\n0,empty.xyz\n0.5,near.xyz\n2,{}\n", whole.display()));
    write("empty.xyz", "nan nan nan\nnan 1 2\n");
    write("near.xyz", "0 0 0\n0.0001 0 0\n5 0 0\n");
    write("far.xyz", "1e200 0 0\n5 1 0\n");
    let output = yard.marsyard(["localise", "o.csv", "--sweeps", "s.csv", "--sensor=0,0,1", "--json"]);
    let said: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    let told = serde_json::json!({
        "listed": 3, "read": 3, "found_again": 0, "empty": 1, "points": 7, "not_finite": 2, "at_sensor": 3, "on_rover": 0
    });
    assert_eq!(said["sweeps"], told, "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("warning: no sweep showed again"), "{}", text(&output.stderr));
    let poses = std::fs::read_to_string(yard.path("located/sweeps.tum")).expect("a file");
    let at: Vec<&str> = poses.lines().map(|line| line.split(' ').next().expect("a time")).collect();
    assert_eq!(at, ["0", "0.5", "2"]);
    // Poses of sweeps are no part of a later run that reads none, which says so.
    let later = yard.marsyard(["localise", "o.csv"]);
    assert!(later.status.success() && text(&later.stderr).contains("sweeps.tum was there before"), "{later:?}");
}

#[test]
fn extreme_sweeps_that_cannot_be_read_are_refused_before_anything_is_written() {
    let yard = Yard::new();
    let write = |name: &str, text: &str| std::fs::write(yard.path(name), text).expect("a file");
    write("o.csv", "time_s,speed_mps,yaw_rate_radps\n0,0,0\n1,0,0\n");
    write("absent.csv", "time_s,file\n0,a.xyz\n");
    write("shape.csv", "time_s,file\n0,o.stl\n");
    write("o.stl", "solid\n");
    write("folder.csv", "time_s,file\n0,.\n");
    write("twice.csv", "time_s,file\n0,words.xyz\n1,words.xyz\n");
    write("words.csv", "time_s,file\n0,words.xyz\n");
    write("words.xyz", "1 2 3\n1 2 far\n");
    write("f.csv", "time_s,range_m,bearing_rad\n0,2,0\n");
    let at_origin = "--sensor=0,0,1";
    for (arguments, said) in [
        (&["--sweeps", "absent.csv", at_origin][..], "absent.csv:2: a.xyz: there is no such file"),
        (
            &["--sweeps", "absent.csv", at_origin],
            "name a sweep's file, by its whole path or by that from the list's folder",
        ),
        (&["--sweeps", "folder.csv", at_origin], "folder.csv:2: .: there is no such file"),
        (&["--sweeps", "twice.csv", at_origin], "twice.csv:3: file words.xyz stands in line 2 already"),
        (&["--sweeps", "words.csv", at_origin, "--unknown-ids"], "cannot be used with"),
        (&["--sweeps", "shape.csv", at_origin], "the format of a cloud is told by its name"),
        (&["--sweeps", "words.csv", at_origin], "words.xyz: line 2"),
        (&["--sweeps", "words.csv"], "--sensor <X,Y,Z[,YAW,PITCH,ROLL]>"),
        (&["--sweeps", "words.csv", at_origin, "--features", "f.csv"], "cannot be used with"),
        (
            &["--sweeps", "words.csv", "--sensor=0,0,1,5"],
            "4 numbers; three are needed, or six where the sensor is turned",
        ),
        (&["--sweeps", "words.csv", at_origin, "--self-filter=1,0,1"], "metres above 0 are needed"),
        (&["--sweeps", "words.csv", at_origin, "--feature-range-m=50"], "a number of 0.5 to 20 is needed"),
        (&["--self-filter=1,1,1"], "--sweeps <CSV>"),
    ] {
        let output = yard.marsyard(["localise", "o.csv"].iter().chain(arguments));
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        // Messages are wrapped.
        let told = text(&output.stderr).split_whitespace().filter(|&word| word != "│").collect::<Vec<_>>().join(" ");
        assert!(told.contains(said), "{told}");
        assert!(!yard.path("located/trajectory.tum").exists(), "{arguments:?}");
    }
}
