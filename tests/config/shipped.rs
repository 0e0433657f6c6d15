//! Contract: what ships is checked, names its schema, and says what it is for.

use std::path::{Path, PathBuf};

use marsyard::config::{self, load};

fn yaml_files(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "yaml"));
    files.sort();
    files
}

#[test]
fn law_every_shipped_file_names_its_schema() {
    for (folder, schema) in [
        ("configs", "../schemas/corpus.schema.json"),
        ("configs/train", "../../schemas/train.schema.json"),
        ("configs/rovers", "../../schemas/rover.schema.json"),
        ("configs/sensors", "../../schemas/sensor.schema.json"),
    ] {
        assert!(!yaml_files(folder).is_empty());
        for path in yaml_files(folder) {
            let text = std::fs::read_to_string(&path).unwrap();
            let line = format!("# yaml-language-server: $schema={schema}");
            assert_eq!(text.lines().next(), Some(line.as_str()), "{}", path.display());
            assert!(Path::new(folder).join(schema).exists());
        }
    }
}

/// Each preset under its file's name, in a config of its own.
#[test]
fn equal_presets_by_name_and_by_path() {
    for (key, section, folder) in [("rover", "drive", "rovers"), ("sensor", "sweep", "sensors")] {
        let files = yaml_files(&format!("configs/{folder}"));
        assert_eq!(files.len(), config::shipped(key).len(), "a file is not in the binary: {files:?}");
        for (name, _) in config::shipped(key) {
            let with = |value: &str| {
                let sets = [format!("{section}.{key}={value}"), "slam=truth".into(), "scene.extent_m=40".into()];
                load(Path::new("configs/quickstart.yaml"), &sets).unwrap_or_else(|error| panic!("{}", error.lines()))
            };
            let (by_name, by_path) = (with(name), with(&format!("./{folder}/{name}.yaml")));
            assert_eq!(by_name, by_path);
            assert!(by_name.to_yaml().contains(&format!("name: {name}\n")), "{name}");
        }
    }
}

#[test]
fn law_shipped_configs_have_full_splits() {
    for path in yaml_files("configs") {
        let plan = load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.lines()));
        assert_eq!(plan.shards() % 20, 0, "{}: 14 + 3 + 3 in every 20 shards", path.display());
        assert_eq!(path.file_stem().unwrap().to_str(), Some(plan.name.as_str()));
    }
}

#[test]
fn equal_the_default_training_config_and_the_defaults() {
    let read = |name: &str| {
        let path = PathBuf::from(format!("configs/train/{name}.yaml"));
        config::load_train(Some(&path), &[]).unwrap_or_else(|error| panic!("{}", error.lines()))
    };
    assert_eq!(read("default"), config::load_train(None, &[]).unwrap());
    assert!(!read("paper").network.bias);
    assert_ne!(read("robust"), read("default"));
}
