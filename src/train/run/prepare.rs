//! Setup -> a training at its first row, or where it was interrupted. Nothing is written before everything is known to be sound.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::Value as Json;

use super::checkpoint::{Checkpoint, Cursor};
use super::{Event, Init, Setup, Start, Tell, Training};
use crate::corpus::Split;
use crate::train::folder::{self, RunFolder};
use crate::train::learner::Learner;
use crate::train::looks::Looks;
use crate::train::rows::{LeftOut, only_class};
use crate::train::scaling::scaler;
use crate::train::validation::{Objective, Validation, each_group};
use crate::train::{Layout, Sources, TrainError, state, stream};

impl<'s> Training<'s> {
    /// `begun`: the folder, where the run was begun before.
    pub(super) fn prepare(
        setup: &'s Setup,
        identity: Json,
        begun: Option<RunFolder>,
        tell: Tell,
    ) -> Result<Training<'s>, TrainError> {
        let (params, sources) = (&setup.params, &setup.sources);
        let counts = class_counts(sources)?;
        let labelled: u64 = counts.iter().flatten().sum();
        let validate_every = params.rows_between_looks(labelled);
        if labelled == 0 {
            let unlabelled = sources.list.iter().map(|source| source.labels(Split::Train).unknown).sum();
            return Err(no_rows(sources, Split::Train, LeftOut { unlabelled, ..LeftOut::default() }));
        }
        // They read different splits, and neither needs the other.
        let look_rows = params.filter.look_rows(validate_every);
        let (validation, scaled) = rayon::join(|| Validation::open(sources, look_rows), || scaler(sources, params));
        let validation = validation?;
        if validation.rows == 0 {
            return Err(no_rows(sources, Split::Validation, validation.left_out));
        }
        let layout = params.layout(sources.features.len());
        if labelled < layout.weights_of_member() as u64 && !params.allow_few_rows {
            return Err(TrainError::FewRows { rows: labelled, weights: layout.weights_of_member() });
        }
        let untraversable: u64 = counts.iter().map(|of| of[1]).sum();
        let label = only_class([labelled - untraversable, untraversable]);
        if let (Some(label), false) = (label, params.allow_one_class) {
            return Err(TrainError::OneClass { rows: labelled, label });
        }
        let (mut scaler, constant) = scaled?;
        if let Some(init) = &setup.init {
            // Its weights mean what they mean behind its own scaling.
            scaler.clone_from(&init.model.about.scaler);
        }
        let corpora: Vec<f64> = sources.list.iter().map(|source| source.weight).collect();
        let objective = Objective::new(scaler, params, &counts, &corpora);
        let validation = validation.for_looks_by(&objective);
        let mut learner = Learner::new(params, objective, validate_every)?;
        learner.share_work();
        let covariance = setup.init.as_ref().map(|init| start_from(init, sources, &mut learner)).transpose()?;
        if let Some([low, high]) =
            setup.init.as_ref().map(|init| init.model.about.targets).filter(|of| *of != params.targets)
        {
            tell(Event::Note(&format!(
                "the network it starts from learnt the targets {low} and {high}, this training has {} and {}; --set targets=[{low},{high}] keeps them",
                params.targets[0], params.targets[1]
            )));
        }
        let mut run = match begun {
            Some(run) => run,
            None => begin(setup)?,
        };
        let (mut place, mut looks) = (Cursor::default(), Looks::default());
        if let Some(checkpoint) = Checkpoint::read(setup, &run, &identity, layout.weights())? {
            if !checkpoint.checked {
                tell(Event::Note("the checkpoint is of an earlier marsyard, and has no checksum to be judged by"));
            }
            learner.filter.restore(&checkpoint.now.filter)?;
            learner.network.weights = checkpoint.now.weights;
            (learner.best, learner.early, learner.learnt) = (checkpoint.best, checkpoint.early, checkpoint.learnt);
            (place, looks) = (checkpoint.place, checkpoint.looks);
        }
        run.write_config(&setup.config_yaml)?;
        let log = run.log(&looks)?;
        let elapsed_s = looks.lines().last().map_or(0.0, |line| line.elapsed_s);
        Ok(Training {
            start: Start {
                train_rows: labelled,
                validation_rows: validation.rows,
                look_rows: validation.looked_at.rows().len() as u64,
                untraversable_share: untraversable as f64 / labelled as f64,
                weights: layout.weights(),
                features: sources.features.clone(),
                constant,
                class_weights: learner.objective.weights.class,
                validate_every: learner.validate_every,
                stream_bytes: stream::memory_bytes(sources, setup.ahead),
                resumed_at: learner.learnt.rows,
                one_class: label.is_some(),
                covariance,
            },
            identity,
            validation,
            learner,
            place,
            looks,
            log,
            started: Instant::now(),
            elapsed_before: Duration::try_from_secs_f64(elapsed_s).unwrap_or_default(),
            checkpoint: (Instant::now(), Duration::ZERO),
            setup,
            run,
        })
    }
}

/// A new folder, or one in which a run was killed in its first moments.
fn begin(setup: &Setup) -> Result<RunFolder, TrainError> {
    let run = RunFolder::begin(&setup.out, &setup.config_yaml, setup.resume)?;
    if run.holds(folder::FILTER)? {
        // Another process began and finished it while this one read the corpora.
        return Err(TrainError::Busy { path: setup.out.display().to_string() });
    }
    Ok(run)
}

/// Rows of each class in the train split, by corpus.
fn class_counts(sources: &Arc<Sources>) -> Result<Vec<[u64; 2]>, TrainError> {
    if sources.rule.is_none() && !sources.seen_alone {
        let of = |labels: crate::corpus::stats::LabelCounts| [labels.traversable, labels.untraversable];
        return Ok(sources.list.iter().map(|source| of(source.labels(Split::Train))).collect());
    }
    // Another rule gives other labels, and cells without points may be left out: the rest is counted.
    let mut counts = vec![[0; 2]; sources.list.len()];
    each_group(Arc::new(sources.labels_alone()), Split::Train, |rows| {
        for (&label, &corpus) in rows.labels.iter().zip(&rows.corpora) {
            counts[usize::from(corpus)][label.index()] += 1;
        }
    })?;
    Ok(counts)
}

fn no_rows(sources: &Sources, split: Split, left_out: LeftOut) -> TrainError {
    let LeftOut { unlabelled, not_finite } = left_out;
    let (split, shards) = (split.name(), sources.shards(split));
    if shards > 0 && unlabelled + not_finite == 0 {
        return TrainError::EmptySplit { split, shards };
    }
    TrainError::NoRows { split, shards, unlabelled, not_finite }
}

/// Takes over weights, and the filter's memory where it fits; whether it did.
fn start_from(init: &Init, sources: &Sources, learner: &mut Learner) -> Result<bool, TrainError> {
    let Learner { network, filter, .. } = learner;
    let refuse = |reason: String| Err(TrainError::Init { path: init.path.clone(), reason });
    if init.model.about.features != sources.features {
        let (there, here) = (init.model.about.features.join(" "), sources.features.join(" "));
        return refuse(format!("its inputs are {there}, these are {here}; choose the same with --set features=..."));
    }
    if init.model.network.layout != network.layout {
        let shape = |layout: &Layout| {
            let Layout { bias, members, activation, .. } = layout;
            format!("{:?} with bias {bias}, members {members}, activation {}", layout.sizes(), activation.name())
        };
        let (there, here) = (shape(&init.model.network.layout), shape(&network.layout));
        let Layout { hidden, bias, members, activation, .. } = &init.model.network.layout;
        let activation = activation.name();
        let scores = !init.model.about.scaler.scores.is_empty();
        return refuse(format!(
            "its layers are {there}, the config's {here}; choose the same with --set network.hidden={hidden:?} --set network.bias={bias} \
             --set network.members={members} --set network.activation={activation} --set network.normal_scores={scores}"
        ));
    }
    network.weights.clone_from(&init.model.network.weights);
    let Some(bytes) = &init.filter else { return Ok(false) };
    let read = state::from_bytes(bytes).map(|mut state| state.snapshots.remove("best"));
    match read {
        Ok(Some(best)) if best.weights == network.weights => match filter.restore(&best.filter) {
            Ok(()) => {
                filter.begin_anew();
                Ok(true)
            }
            Err(error) => refuse(format!(
                "the filter.safetensors beside it does not fit ({error}); take the same filter, or move filter.safetensors away"
            )),
        },
        Ok(_) => refuse("the filter.safetensors beside it belongs to other weights; move it away".into()),
        Err(reason) => refuse(format!("filter.safetensors: {reason}; move it away")),
    }
}
