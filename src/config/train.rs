//! A training config as written -> [`TrainParams`] as checked, by the same steps as a corpus config.

use std::path::Path;

use super::error::{ConfigError, Fault, quoted};
use super::form::Schema;
use super::key_path::KeyPath;
use super::load::without;
use super::overrides::with_set;
use super::reader::Reader;
use super::schema::{Kind, schema};
use super::shape;
use super::tree::{Source, Span, Value};
use super::values::value_faults;
use super::write::yaml;
use crate::cells::{LabelRule, Unanswerable};
use crate::train::{Activation, TrainParams};

/// Reads and checks a training config; without a path, the defaults. `sets` are overrides like `network.hidden=[8]`.
pub fn load_train(path: Option<&Path>, sets: &[String]) -> Result<TrainParams, ConfigError> {
    let shown = path.map_or("the default training config".to_string(), |path| path.display().to_string());
    let mut reader = path.map_or_else(Reader::default, Reader::beside);
    read(path, &shown, sets, &mut reader).map_err(|faults| ConfigError {
        unreachable: reader.unreachable.get(),
        untrusted: reader.untrusted.get(),
        ..ConfigError::new(shown, &reader.sources, faults)
    })
}

/// The parameters as a config with every default written out; [`load_train`] gives the same again.
pub(crate) fn train_yaml(params: &TrainParams) -> String {
    let document = serde_json::to_value(params).expect("parameters are finite numbers and text keys");
    format!("# The resolved training config: every default written out.\n{}", yaml(&document))
}

fn read(path: Option<&Path>, shown: &str, sets: &[String], reader: &mut Reader) -> Result<TrainParams, Vec<Fault>> {
    let one = |fault: Fault| vec![fault];
    let folder = path.and_then(Path::parent).map(Path::to_owned).unwrap_or_default();
    let text = path.map_or(Ok("{}".to_string()), |path| reader.text_of(path));
    let (text, unreadable) = text.map_or_else(|why| (String::new(), Some(why)), |text| (text, None));
    let is_shown = unreadable.is_some() || path.is_none_or(|path| reader.may_show(path));
    let source = Source { name: shown.into(), text: text.into(), folder, is_shown };
    if let Some(why) = unreadable {
        reader.sources.push(source);
        return Err(one(Fault::new(Span::default(), format!("the config cannot be read: {why}"))));
    }
    let mut root = reader.parse(source).map_err(one)?;
    if matches!(root.value, Value::Null) {
        // Nothing but comments: all defaults.
        root.value = Value::Map(Vec::new());
    }
    for argument in sets {
        root = with_set(root, argument, reader, Kind::Train).map_err(one)?;
    }
    let whole = schema(Kind::Train);
    let mut faults = shape::check(&root, Schema::of(whole), "", whole, &reader.sources);
    let sound = faults.is_empty();
    // What has a wrong shape is left out, so that the rest is judged in the same go.
    let rest = if sound { Some(root.clone()) } else { without(&root, &faults) };
    if let Some(rest) = rest {
        let written = rest.to_json();
        let names = |key: &str| written.pointer(key).is_some();
        let [names_hidden, names_members, names_scores] =
            ["/network/hidden", "/network/members", "/network/normal_scores"].map(names);
        let [names_patience, names_targets] = ["/patience", "/targets"].map(names);
        match serde_json::from_value::<TrainParams>(written) {
            Ok(mut params) => {
                let usual = TrainParams::usual_of(params.filter.clone());
                if !names_hidden {
                    params.network.hidden = usual.network.hidden;
                }
                if !names_members {
                    params.network.members = usual.network.members;
                }
                if !names_scores {
                    params.network.normal_scores = usual.network.normal_scores;
                }
                if !names_patience {
                    params.patience = usual.patience;
                }
                if !names_targets {
                    params.targets = usual.targets;
                }
                let place = KeyPath { root: &root };
                faults.extend(value_faults(&params, &place, "", Kind::Train));
                rules(&params, &place, &mut faults);
                if faults.is_empty() {
                    return Ok(params);
                }
            }
            Err(error) if sound => {
                faults
                    .push(Fault::new(root.span, format!("the config cannot be read: {}", quoted(&error.to_string()))));
            }
            Err(_) => (),
        }
    }
    Err(faults)
}

/// Rules between keys.
fn rules(params: &TrainParams, place: &KeyPath, faults: &mut Vec<Fault>) {
    let [low, high] = params.targets;
    if low >= high {
        let rule = format!("'targets' must rise, from traversable to untraversable, got [{low}, {high}]");
        faults.push(
            Fault::new(place.span("targets"), rule)
                .cure("the paper's are [0.1, 0.9], those of the logarithmic loss [0, 1]"),
        );
    }
    if params.thresholds.windows(2).any(|pair| pair[0] >= pair[1]) {
        let rule = "'thresholds' must rise: each is the border between two classes";
        faults.push(Fault::new(place.span("thresholds"), rule).cure("one border: [0.5]"));
    }
    if params.network.members > 1 && !params.filter.learns_by_batches() {
        let rule = "'network.members' above 1 goes with 'filter.kronecker' only: the members learn side by side, each for itself";
        let at = Fault::new(place.span("network.members"), rule);
        faults.push(
            at.also(place.span("filter"), "this filter learns one network")
                .cure("take it out: the filter has one network then"),
        );
    }
    let activation = params.network.activation;
    if activation != Activation::Logistic && !params.filter.learns_by_batches() {
        let rule = format!(
            "'network.activation: {}' goes with 'filter.kronecker' only: steps of the other filters are measured with logistic neurons alone",
            activation.name()
        );
        let at = Fault::new(place.span("network.activation"), rule);
        faults.push(
            at.also(place.span("filter"), "this filter learns logistic neurons")
                .cure("take it out, or write filter: {kronecker: {}}"),
        );
    } else if activation == Activation::Both && params.network.members < 2 {
        let rule = "'network.activation: both' needs 2 members or more: the first is logistic, the second rectified";
        let at = Fault::new(place.span("network.activation"), rule);
        faults.push(
            at.also(place.span("network.members"), "one network")
                .cure("write activation: logistic or relu, or members: 2"),
        );
    }
    let answer = params.labels.as_ref().map_or(Ok(()), LabelRule::check_answerable);
    if let Err(said @ Unanswerable::TwoRules) = &answer {
        faults.push(Fault::new(place.span("labels.min_margin_m"), said.to_string()));
    } else if answer.is_err() {
        let rule = "'labels.min_obstacle_points' above 1 goes with 'labels.obstacle: as_built' only: the corpus counts the points of \
                    its own obstacles alone";
        let at = Fault::new(place.span("labels.min_obstacle_points"), rule);
        faults.push(at.also(place.span("labels.obstacle"), "another rule than the corpus's"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(text: &str, sets: &[&str]) -> String {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("train.yaml");
        std::fs::write(&path, text).unwrap();
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_string()).collect();
        match load_train(Some(&path), &sets) {
            Ok(params) => format!("fine: {params:?}"),
            Err(error) => error.lines().replace(&format!("{}/", dir.path().display()), ""),
        }
    }

    #[test]
    fn equal_defaults_and_an_empty_config() {
        assert_eq!(load_train(None, &[]).unwrap(), TrainParams::default());
        assert!(faults("# nothing\n", &[]).starts_with("fine"));
    }

    #[test]
    fn exact_a_kalman_filter_brings_the_papers_network_and_patience_unless_others_are_named() {
        let of = |sets: &[&str]| {
            let sets: Vec<String> = sets.iter().map(|set| (*set).to_string()).collect();
            let params = load_train(None, &sets).unwrap();
            assert_eq!(params.network.members, if params.filter.learns_by_batches() { 2 } else { 1 });
            assert_eq!(params.network.normal_scores, params.filter.learns_by_batches());
            (params.network.hidden, params.patience)
        };
        assert_eq!(of(&[]), (vec![64, 64], 10));
        assert_eq!(of(&["filter.kronecker.rate=0.01", "network.bias=false"]), (vec![64, 64], 10));
        for filter in ["ekf={}", "decoupled={}", "ukf={}", "backprop={}"] {
            let filter = format!("filter.{filter}");
            assert_eq!(of(&[&filter]), (vec![16, 16], 5), "{filter}");
            assert_eq!(of(&[&filter, "network.hidden=[5]", "patience=7"]), (vec![5], 7), "{filter}");
            let with = [filter, "network.normal_scores=true".to_string()];
            assert!(load_train(None, &with).unwrap().network.normal_scores);
        }
    }

    #[test]
    fn exact_a_loss_brings_its_targets_unless_others_are_named() {
        let targets = |sets: &[&str]| {
            load_train(None, &sets.iter().map(ToString::to_string).collect::<Vec<_>>()).unwrap().targets
        };
        assert_eq!(targets(&["filter.kronecker.rate=0.01"]), [0.0, 1.0]);
        assert_eq!(targets(&["filter={kronecker: {loss: squared}}"]), [0.1, 0.9]);
        assert_eq!(targets(&["filter.ekf={}"]), [0.1, 0.9]);
        for loss in ["squared", "logarithmic"] {
            assert_eq!(targets(&[&format!("filter.kronecker.loss={loss}"), "targets=[0.05, 0.95]"]), [0.05, 0.95]);
        }
    }

    #[test]
    fn equal_a_resolved_config_and_what_it_is_read_to() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("train.yaml");
        let sets = [
            "filter={decoupled: {groups: layer}}",
            "features={columns: [a, b]}",
            "labels={obstacle: {taller_than_m: 0.2}}",
        ];
        let params = load_train(None, &sets.map(String::from)).unwrap();
        std::fs::write(&path, train_yaml(&params)).unwrap();
        assert_eq!(load_train(Some(&path), &[]).unwrap(), params);
    }

    #[test]
    fn exact_every_fault_is_told_with_its_place_in_one_go() {
        let told = faults("epoch: 3\nnetwork: {hidden: [0]}\ntargets: [0.9, 0.1]\n", &["clip=-1"]);
        for part in [
            "train.yaml:1:1: unknown key 'epoch'; did you mean 'epochs'?",
            "network.hidden",
            "'targets' must rise",
            "--set:1:6: 'clip' must lie in [0.5, 1000000], got -1",
        ] {
            assert!(told.contains(part), "{part} in:\n{told}");
        }
        let told =
            faults("labels: {obstacle: all, min_obstacle_points: 3}\nthresholds: [0.5, 0.5]\nvalidate_every: 0", &[]);
        for part in ["as_built", "'thresholds' must rise", "'validate_every' must be a whole number in [1, "] {
            assert!(told.contains(part), "{part} in:\n{told}");
        }
        let told = faults("filter: {ekf: {}}\nnetwork: {members: 3}", &[]);
        let part = "train.yaml:2:20: 'network.members' above 1 goes with 'filter.kronecker' only";
        assert!(told.contains(part) && told.contains("take it out"), "{part} in:\n{told}");
        let told = faults("filter: {ekf: {}}\nnetwork: {activation: relu}", &[]);
        let part = "train.yaml:2:23: 'network.activation: relu' goes with 'filter.kronecker' only";
        assert!(told.contains(part) && told.contains("take it out"), "{part} in:\n{told}");
        let told = faults("network: {activation: both, members: 1}", &[]);
        let part = "train.yaml:1:23: 'network.activation: both' needs 2 members or more";
        assert!(told.contains(part) && told.contains("or members: 2"), "{part} in:\n{told}");
        assert!(faults("network: {activation: both}", &[]).starts_with("fine"));
        assert!(faults("filter: {ekf: {loss: logarithmic}}", &[]).contains("unknown key 'loss'"));
        assert!(faults("filter: ekf", &[]).contains("write {ekf: {}} for its defaults"));
        let told = faults("labels: {obstacle: taller_than_wheel}", &[]);
        for part in [
            "'labels.obstacle: taller_than_wheel' needs a value",
            "write obstacle: {taller_than_wheel: VALUE}: Those that",
        ] {
            assert!(told.contains(part), "{part} in:\n{told}");
        }
        assert!(faults("", &["epochs"]).contains("network.hidden=[8]"));
    }
}
