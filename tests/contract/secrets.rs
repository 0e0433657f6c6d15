//! What a file holds that a config or a command line names is in no message, unless it is the user's own config.

use std::process::Output;

use crate::yard::{Yard, text};

const HUSH: &str = "hush4711neverToBeSeen";

/// Everything that was said, without the line ends and borders that wrapping puts in.
fn said(output: &Output) -> String {
    let all = format!("{}{}", text(&output.stdout), text(&output.stderr));
    all.chars().filter(|c| !c.is_whitespace() && *c != '│').collect()
}

/// A config in a folder of its own, and files with secrets beside that folder, in it by a link, and hidden in it.
fn yard() -> Yard {
    let yard = Yard::new();
    std::fs::create_dir_all(yard.path("own/.aws")).expect("a folder");
    let config = std::fs::read_to_string(Yard::everything()).expect("the fixture");
    std::fs::write(yard.path("own/config.yaml"), config).expect("a file");
    let outside = [
        ("credentials", format!("[default]\naws_secret_access_key = {HUSH}\n")),
        ("keys.yaml", format!("aws_secret_access_key: {HUSH}\n{HUSH}: 1\n")),
        ("list.yaml", format!("[{HUSH}, {HUSH}]\n")),
        ("text.yaml", format!("{HUSH}\n")),
        ("twice.yaml", format!("{HUSH}: 1\n{HUSH}: 2\n")),
        ("broken.yaml", format!("a: [{HUSH}\n b: }}{HUSH}")),
        ("tag.yaml", format!("a: !{HUSH} 1\n")),
        ("quotes.yaml", format!("\"x' {HUSH} '\": 1\n")),
        ("near.yaml", format!("wheel_radius_m: {HUSH}\nwheelbase_m: [1, {HUSH}]\nname: {{{HUSH}: 1}}\n")),
    ];
    for (name, content) in &outside {
        std::fs::write(yard.path(name), content).expect("a file");
    }
    std::fs::write(yard.path("own/.aws/credentials.yaml"), format!("key: {HUSH}\n")).expect("a file");
    std::os::unix::fs::symlink("../keys.yaml", yard.path("own/link.yaml")).expect("a link");
    yard
}

#[test]
fn regress_no_message_shows_a_file_that_is_not_the_user_s_config() {
    let yard = yard();
    let names = ["credentials", "keys.yaml", "list.yaml", "text.yaml", "twice.yaml", "broken.yaml", "tag.yaml"];
    let names = names.into_iter().chain(["quotes.yaml", "near.yaml"]).map(|name| format!("../{name}"));
    let more = ["link.yaml", ".aws/credentials.yaml", "/proc/self/environ"].map(String::from);
    for named in names.chain(more) {
        for key in ["sweep.sensor", "drive.rover"] {
            for log in ["text", "json"] {
                let set = format!("{key}={named}");
                let mut command = yard.command(["--log", log, "plan", "own/config.yaml", "--set", &set]);
                let output = command.env("AWS_SECRET_ACCESS_KEY", HUSH).output().expect("the binary starts");
                let said = said(&output);
                assert_eq!(output.status.code(), Some(2), "{set}: {said}");
                assert!(!said.contains(HUSH), "{set}, --log {log}: {said}");
                let file = named.rsplit('/').next().expect("a name");
                assert!(said.contains(file) && said.contains("notshown"), "{set}, --log {log}: {said}");
            }
        }
    }
}

#[test]
fn regress_no_message_of_a_pattern_a_training_config_a_mapping_or_a_cloud_shows_the_file() {
    let yard = yard();
    std::fs::write(yard.path("beams.csv"), format!("time_s,azimuth_deg,elevation_deg\n{HUSH},0,0\n")).expect("a file");
    std::fs::write(yard.path("scan.csv"), format!("x,y,z\n1,2,{HUSH}\n")).expect("a file");
    std::fs::write(yard.path("head.csv"), format!("{HUSH} = {HUSH}\n1 2 3\n")).expect("a file");
    let model = crate::classify::model_file(&yard);
    let pattern = "sweep.sensor.pattern={file: {path: ../beams.csv}}";
    let pose = "--pose=0,0,0,0,0,0";
    let calls: [&[&str]; 9] = [
        &["plan", "own/config.yaml", "--set", pattern],
        &["plan", "credentials"],
        &["train", "none", "--config", "credentials"],
        &["train", "none", "--config", "own/link.yaml"],
        &["evaluate", "keys.yaml", "own"],
        &["classify", &model, "scan.csv", pose],
        &["classify", &model, "head.csv", pose],
        &["classify", &model, "scan.csv", pose, "--labels", "keys.yaml"],
        &["classify", &model, "scan.csv", "--trajectory", "credentials"],
    ];
    for call in calls {
        for log in ["text", "json"] {
            let output = yard.marsyard(["--log", log].iter().chain(call));
            let said = said(&output);
            assert_eq!(output.status.code(), Some(2), "{call:?}: {said}");
            assert!(!said.contains(HUSH), "{call:?}: {said}");
        }
    }
}

#[test]
fn law_the_user_s_own_config_is_shown_with_its_fault() {
    let yard = yard();
    std::fs::create_dir(yard.path("own/rovers")).expect("a folder");
    std::fs::write(yard.path("own/rovers/mine.yaml"), "wheel_radius: seen4711\n").expect("a file");
    let output = yard.marsyard(["plan", "own/config.yaml", "--set", "drive.rover=rovers/mine.yaml"]);
    let said = said(&output);
    assert!(output.status.code() == Some(2) && said.contains("seen4711") && said.contains("didyoumean"), "{said}");
    // Of another's file, the rule and the line.
    let output = yard.marsyard(["--log", "json", "plan", "own/config.yaml", "--set", "drive.rover=../near.yaml"]);
    assert!(text(&output.stderr).contains(r#"near.yaml","line":1,"#), "{}", text(&output.stderr));
}

#[test]
fn regress_a_preset_file_that_is_bare_text_says_what_is_wrong() {
    let yard = yard();
    std::fs::write(yard.path("own/one-line.yaml"), "kapvik\n").expect("a file");
    let output = yard.marsyard(["plan", "own/config.yaml", "--set", "drive.rover=one-line.yaml"]);
    let said = said(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("1fault,") && said.contains("aroverfileisamapping"), "{said}");
    assert!(said.contains("marsyardschemacorpus"), "{said}");
}
