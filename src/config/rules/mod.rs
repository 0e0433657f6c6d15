//! Rules that bind several keys: what contradicts itself is refused, with both places named.
//!
//! Rules of one key are the types' own (`garde`); here stand those of the document and between families, and beside it those of a family's
//! sections, in the order of the flow.

mod cells;
mod drive;
mod sweep;
mod yard;

use super::document::Document;
use super::error::Fault;
use super::key_path::KeyPath;
use crate::cells::CellParams;
use crate::plan::Family;

/// Rules of the document as a whole.
pub(crate) fn of_document(document: &Document, place: &KeyPath, faults: &mut Vec<Fault>) {
    let (scenes, per_shard) = (document.scenes, u64::from(document.scenes_per_shard));
    if per_shard > 0 && scenes % per_shard != 0 {
        let below = scenes / per_shard * per_shard;
        let near = if below == 0 { format!("{per_shard}") } else { format!("{below} or {}", below + per_shard) };
        faults.push(
            Fault::new(
                place.span("scenes"),
                format!("scenes ({scenes}) must be a multiple of scenes_per_shard ({per_shard})"),
            )
            .cure(format!("write scenes: {near}"))
            .also(place.span("scenes_per_shard"), "a shard is full"),
        );
    }
    for (i, table) in document.tables.iter().enumerate() {
        if let Some(first) = document.tables[..i].iter().position(|earlier| earlier == table) {
            faults.push(
                Fault::new(place.span(&format!("tables[{i}]")), "the same table twice")
                    .also(place.span(&format!("tables[{first}]")), "first here"),
            );
        }
    }
    let families = &document.families;
    for (i, family) in families.iter().enumerate() {
        if let Some(first) = families[..i].iter().position(|earlier| earlier.name == family.name) {
            faults.push(
                Fault::new(
                    place.span(&format!("families[{i}].name")),
                    format!("two families are named '{}'", family.name),
                )
                .cure("give each its own name")
                .also(place.span(&format!("families[{first}].name")), "first here"),
            );
        }
    }
    let training: f64 = families.iter().filter(|family| !family.hold_out).map(|family| family.weight).sum();
    if !families.is_empty() && families.iter().all(|family| family.hold_out) {
        faults.push(
            Fault::new(place.span("families"), "every family is held out: nothing is left to train on")
                .cure("take hold_out from at least one"),
        );
    } else if !families.is_empty() && training <= 0.0 {
        faults.push(
            Fault::new(place.span("families"), "the weights of the families that are not held out add up to 0")
                .cure("give one of them a positive weight"),
        );
    }
}

/// Columns are the same in all scenes, so families must agree on what makes them.
pub(crate) fn between_families(families: &[(Family, KeyPath)], faults: &mut Vec<Fault>) {
    let Some(((first, first_place), others)) = families.split_first() else { return };
    for (family, place) in others {
        let mut differ = |key: &str, ours: String, theirs: String, why: &str| {
            if ours != theirs {
                let rule = format!(
                    "{key} is {theirs} in family '{}' and {ours} in family '{}': {why}",
                    family.name, first.name
                );
                faults.push(
                    Fault::new(place.span(key), rule)
                        .cure("set it once, in the document's own section")
                        .also(first_place.span(key), format!("for '{}'", first.name)),
                );
            }
        };
        let (a, b) = (&first.cells, &family.cells);
        differ("cells.size_m", a.size_m.to_string(), b.size_m.to_string(), "one corpus has one grid");
        differ(
            "cells.neighbours",
            a.neighbours.to_string(),
            b.neighbours.to_string(),
            "one corpus has one set of columns",
        );
        let local = |cells: &CellParams| cells.local_height.as_ref().map_or("absent".to_owned(), |local| local.words());
        differ("cells.local_height", local(a), local(b), "one corpus has one set of columns");
        let curvature = |cells: &CellParams| cells.curvature.as_ref().map_or("absent".to_owned(), |all| all.words());
        differ("cells.curvature", curvature(a), curvature(b), "one corpus has one set of columns");
        let around = |cells: &CellParams| cells.surroundings.as_ref().map_or("absent".to_owned(), |all| all.words());
        differ("cells.surroundings", around(a), around(b), "one corpus has one set of columns");
        let beams = |cells: &CellParams| cells.beams.as_ref().map_or("absent".to_owned(), |all| all.words());
        differ("cells.beams", beams(a), beams(b), "one corpus has one set of columns");
        let rover = |cells: &CellParams| if cells.labels.rover.is_some() { "on" } else { "off" }.to_owned();
        differ("cells.labels.rover", rover(a), rover(b), "one corpus has one set of columns");
        let pose = |cells: &CellParams| {
            let is_named = cells.labels.rover.as_ref().is_some_and(|rule| rule.pose);
            if is_named { "named" } else { "absent" }.to_owned()
        };
        differ("cells.labels.rover.pose", pose(a), pose(b), "one corpus has one set of columns");
        let unseen = |cells: &CellParams| cells.unseen.as_ref().map_or("absent".to_owned(), |unseen| unseen.words());
        differ("cells.unseen", unseen(a), unseen(b), "one corpus has one set of columns");
        let drop = |cells: &CellParams| if cells.labels.max_drop_m.is_some() { "named" } else { "absent" }.to_owned();
        differ("cells.labels.max_drop_m", drop(a), drop(b), "one corpus has one set of columns");
        let on = |family: &Family| if family.sweep.effects.intensity.is_some() { "on" } else { "off" }.to_owned();
        differ("sweep.effects.intensity", on(first), on(family), "one corpus has one set of columns");
    }
}

/// Rules of one family's sections.
pub(crate) fn of_family(family: &Family, place: &KeyPath, faults: &mut Vec<Fault>) {
    let mut rules = Rules { family, place, faults };
    rules.yard();
    rules.rocks();
    rules.path();
    rules.stops();
    rules.sensor();
    rules.ranges();
    rules.slam();
    rules.cells();
    rules.frame();
    rules.rover_labels();
    rules.rover();
}

struct Rules<'a, 'p, 'f> {
    family: &'a Family,
    place: &'a KeyPath<'p>,
    faults: &'f mut Vec<Fault>,
}

impl Rules<'_, '_, '_> {
    fn fault(&mut self, key: &str, rule: String, cure: &str, also: &[(&str, &str)]) {
        let mut fault = Fault::new(self.place.span(key), rule).cure(cure);
        // A default stands nowhere: there is nothing to point at.
        for (key, word) in also.iter().filter(|(key, _)| self.place.holds(key)) {
            fault = fault.also(self.place.span(key), *word);
        }
        self.faults.push(fault);
    }
}
