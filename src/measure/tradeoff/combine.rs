//! Gains of single settings -> settings that turn several knobs at once, measured like the others.
//!
//! Of each group of the pipeline the setting that gains most on the reference at equal CPU may take part, where it may be recommended, is
//! not told to be worse and gains more than other draws of the config do. What a combination gains is first taken for the sum of what its
//! parts gain, and the most promising ones are then measured: whether knobs add up is not believed but looked at. Parts that set the same
//! key (a preset and a pose estimate) do not combine; nor what the config's rules refuse.
//!
//! They are measured after the rounds, with the reference beside them, on the scenes and with the seeds of all rounds. Gains are against that
//! reference; costs of scenes and trainings are told in the first measurement's seconds, by the ratio of the two references. Parts are
//! chosen by the same test scenes that judge the whole, so a combination's own gain, and not the sum, is what is told.

use std::sync::atomic::AtomicBool;

use super::report::{Ended, Report, Row, Told, WorthRow};
use super::settings::{self, AS_WRITTEN, Group, OTHER_DRAWS, Setting, Settings, Side, Variant};
use super::{Event, Options, TradeoffError, recommend, rounds};
use crate::config;

/// Settings that turn the knobs of several, the most promising first.
pub(super) fn combinations(options: &Options, settings: &Settings, report: &Report) -> Vec<Setting> {
    let base = &settings.list[0].sets;
    let parts: Vec<Part> = Group::ALL.into_iter().filter_map(|group| Part::best_of(group, report, base)).collect();
    let mut several: Vec<(f64, Vec<&Part>)> = (0..1_u32 << parts.len())
        .filter(|members| members.count_ones() > 1)
        .map(|members| (0..parts.len()).filter(|k| members >> k & 1 == 1).map(|k| &parts[k]).collect())
        .filter(|members: &Vec<&Part>| !share_a_key(members))
        .map(|members| (members.iter().map(|part| part.gain).sum(), members))
        .collect();
    several.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut list = settings.list.clone();
    let before = list.len();
    for (_, members) in several {
        if list.len() - before == options.combinations {
            break;
        }
        let name = members.iter().map(|part| part.name.as_str()).collect::<Vec<_>>().join(" + ");
        let turned: Vec<String> = members.iter().flat_map(|part| part.sets.iter().cloned()).collect();
        let sets = settings::overridden(base, &turned);
        let all: Vec<String> = options.sets.iter().chain(&sets).cloned().collect();
        // What is measured already is not measured again; what a rule refuses is told by no knob of its own.
        let plan = config::load(&options.config, &all).ok().filter(|plan| !settings::is_listed(&list, plan));
        let variant = plan.map(|plan| Variant::Plan(Box::new(plan)));
        list.extend(variant.map(|variant| Setting { group: Some(Group::Combinations), name, sets, variant }));
    }
    list.split_off(before)
}

/// A setting that may take part.
#[derive(Debug)]
struct Part {
    name: String,
    /// What it sets otherwise than the reference.
    sets: Vec<String>,
    gain: f64,
}

impl Part {
    fn best_of(group: Group, report: &Report, base: &[String]) -> Option<Part> {
        let open = |row: &&Row| row.group == Some(group) && row.may_be_recommended && row.name != AS_WRITTEN;
        let gains = report.side(Side::Pipeline).filter(open).filter_map(|row| {
            let gain = row.gain().filter(|gain| gain.told != Told::Worse)?.balanced_accuracy.mean;
            (gain > report.noise_floor.unwrap_or(0.0)).then_some((row, gain))
        });
        let (row, gain) = gains.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let sets = row.sets.iter().filter(|set| !base.contains(set)).cloned().collect();
        Some(Part { name: row.name.clone(), sets, gain })
    }
}

fn share_a_key(parts: &[&Part]) -> bool {
    let keys: Vec<&str> = parts.iter().flat_map(|part| &part.sets).map(|set| settings::key(set)).collect();
    keys.iter().enumerate().any(|(k, key)| keys[..k].contains(key))
}

/// The report with the combinations that were asked for; as it was where there are none, or where `stop` was raised meanwhile.
pub(super) fn add(
    mut report: Report,
    options: &Options,
    settings: &Settings,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Report, TradeoffError> {
    let found = combinations(options, settings, &report);
    if found.is_empty() || report.ended == Ended::Interrupted {
        return Ok(report);
    }
    let kept = |setting: &&Setting| setting.group.is_none() && matches!(setting.variant, Variant::Plan(_));
    let list: Vec<Setting> = settings.list.iter().filter(kept).cloned().chain(found).collect();
    let Some(made) = rounds::again(list, &report, options, stop, tell)? else {
        return Ok(Report { ended: Ended::Interrupted, ..report });
    };
    let ratio = ratio(&report, &made);
    let own = made.rows.into_iter().filter(|row| row.group == Some(Group::Combinations));
    let own: Vec<Row> = own.map(|row| Row { worth: row.worth.map(|worth| scaled(worth, ratio)), ..row }).collect();
    let place = report.rows.iter().rposition(|row| row.side == Side::Pipeline).map_or(0, |last| last + 1);
    report.rows.splice(place..place, own);
    report.recommended_pipeline = recommend::recommend(&report.rows, Side::Pipeline);
    Ok(report)
}

/// Seconds of the first measurement over those of the second: of making the reference's scenes, of training on them, and of both.
fn ratio(first: &Report, second: &Report) -> [f64; 3] {
    let whole = |report: &Report| {
        let reference = report.rows.iter().find(|row| row.group.is_none() && row.name != OTHER_DRAWS)?;
        reference.whole().map(|size| (size.generate_cpu_s, size.train_cpu_s))
    };
    let (Some(first), Some(second)) = (whole(first), whole(second)) else { return [1.0; 3] };
    [first.0 / second.0, first.1 / second.1, (first.0 + first.1) / (second.0 + second.1)]
}

fn scaled(mut worth: WorthRow, [making, training, both]: [f64; 3]) -> WorthRow {
    worth.curve.iter_mut().for_each(|size| size.scale_cpu_s(making, training));
    if let Some(gain) = &mut worth.gain {
        gain.cpu_s *= both;
    }
    worth
}
