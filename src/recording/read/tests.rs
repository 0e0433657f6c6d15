//! Columns in any order, and what is refused with file, line and cure.

use super::*;

const ODOMETRY: &str = "time_s,speed_mps,yaw_rate_radps\n0,0,0\n1,0.5,0.1\n2.5,0.4,0\n";

fn read_features(odometry: &str, features: &str) -> Result<Recording, RecordingError> {
    Recording::read(("o.csv", odometry), Some(SightLog::Features { file: "f.csv", text: features }))
}

#[test]
fn exact_columns_in_any_order_and_empty_values_are_no_readings() {
    let odometry = "# a comment\nyaw_rad, speed_mps ,time_s,yaw_rate_radps\n0.1,0,0,0\n,0.5,1,0.2\n";
    let features = "id,time_s,range_m,bearing_rad,bearing_sigma_rad,range_sigma_m,elevation_sigma_rad\n7,1,2.5,-0.5,,0.2,0.03\n,1,3,0.25,0.01,,\n";
    let recording = read_features(odometry, features).expect("a recording");
    let [(_, first), (time_s, second)] = recording.readings[..] else { panic!("two readings") };
    assert_eq!((first.dt_s, first.yaw_rad, first.roll_rad), (0.0, Some(0.1), Some(0.0)));
    assert_eq!((time_s, second.dt_s, second.speed_mps, second.yaw_rad), (1.0, 1.0, 0.5, None));
    let [(1.0, Observation::Features(ref seen))] = recording.observations[..] else { panic!("one observation") };
    assert_eq!(
        seen.iter().map(|f| (f.polar, f.known, f.sigmas)).collect::<Vec<_>>(),
        [
            ([2.5, -0.5, 0.0], Some(7), [Some(0.2), None, Some(0.03)]),
            ([3.0, 0.25, 0.0], None, [None, Some(0.01), None])
        ]
    );
}

#[test]
fn exact_sweeps_are_named_in_order_of_time_one_a_time() {
    let read = |text: &str| {
        let sweeps = SightLog::Sweeps { file: "s.csv", text };
        Recording::read(("o.csv", ODOMETRY), Some(sweeps)).map(|recording| recording.observations)
    };
    let sweep = |time_s: f64, file: &str, line: u64| (time_s, Observation::Sweep { file: file.into(), line });
    let told = read("# a comment\nfile,time_s,note\nscans/a.bin,0.5,\n\"b, c.ply\",2,x\n");
    assert_eq!(told, Ok(vec![sweep(0.5, "scans/a.bin", 3), sweep(2.0, "b, c.ply", 4)]));
    for (text, said) in [
        ("time_s,file\n1,a.bin\n1,b.bin\n", "s.csv:3: time_s goes from 1 to 1; sort the rows by time, one a time"),
        ("time_s,file\n1,\n", "s.csv:2: file is empty; name the file"),
        ("time_s,file\n1,a.bin\n2,a.bin\n", "s.csv:3: file a.bin stands in line 2 already; name each sweep's own"),
        ("time_s,name\n1,a.bin\n", "s.csv:1: it has no column 'file'; the header names: time_s, name"),
        ("time_s,file\n3,a.bin\n", "s.csv: time_s 3 lies outside the odometry, which goes from 0 to 2.5"),
    ] {
        let error = read(text).expect_err("nonsense").to_string();
        assert!(error.starts_with(said), "{error}");
    }
}

#[test]
fn extreme_nonsense_is_refused_with_file_line_and_cure() {
    let features = "time_s,range_m,bearing_rad\n1,2,0\n";
    for (odometry, features, said) in [
        (ODOMETRY.replace("2.5", "0.5").as_str(), features, "o.csv:4: time_s goes from 1 to 0.5; sort the rows"),
        (ODOMETRY.replace("0.4", "NaN").as_str(), features, "o.csv:4: speed_mps is 'NaN'; write a finite number"),
        (ODOMETRY.replace("speed", "velocity").as_str(), features, "o.csv:1: it has no column 'speed_mps'"),
        (ODOMETRY, "time_s,range_m,bearing_rad\n9,2,0\n", "f.csv: time_s 9 lies outside the odometry"),
        (ODOMETRY, "time_s,range_m,bearing_rad\n1,-2,0\n", "f.csv:2: range_m is -2; a range is above 0"),
        (ODOMETRY, "time_s,range_m,bearing_rad,id\n1,2,0,rock\n", "f.csv:2: id is 'rock'; an id is a whole number"),
        (
            ODOMETRY,
            "time_s,range_m,bearing_rad,range_sigma_m\n1,2,0,0\n",
            "f.csv:2: range_sigma_m is 0; a standard deviation is above 0 and 10 at most, in the unit of the name; empty",
        ),
        (
            ODOMETRY,
            "time_s,range_m,bearing_rad,bearing_sigma_rad\n1,2,0,90\n",
            "f.csv:2: bearing_sigma_rad is 90; a standard deviation is above 0 and 0.5 at most",
        ),
        (ODOMETRY, "time_s,range_m,bearing_rad\n1,2\n", "f.csv:2: it is no table"),
        (ODOMETRY, "time_s,range_m,bearing_rad\n", "f.csv: it holds no row"),
    ] {
        let error = read_features(odometry, features).expect_err("nonsense").to_string();
        assert!(error.starts_with(said), "{error}");
    }
}
