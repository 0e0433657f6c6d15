//! The settings of the trainer: which weights share a covariance, its type and form, rows learnt together. All learn every row, as those
//! must that have no selection. Beside the Kalman filters stands the default, whose network is larger.

use super::settings::{Group, Setting, Variant};
use crate::train::params::{DecoupledParams, EkfParams, FilterParams, Groups, Precision, RowsLearnt};

/// The filters, the full f64 one first: what the trainer's settings are judged by.
pub(super) fn filters() -> Vec<Setting> {
    let ekf = |precision, robust, batch| {
        FilterParams::Ekf(EkfParams { precision, robust, batch, rows: RowsLearnt::Every, ..EkfParams::default() })
    };
    let decoupled = |groups| {
        FilterParams::Decoupled(DecoupledParams { groups, precision: Precision::F64, ..DecoupledParams::default() })
    };
    let mut list = Vec::new();
    let mut add = |group: Option<Group>, name: &str, set: &str, params| {
        let sets = vec![format!("filter={set}")];
        list.push(Setting { group, name: name.into(), sets, variant: Variant::Filter(params) });
    };
    let (f32, f64) = (Precision::F32, Precision::F64);
    add(None, "full covariance, f64", "{ekf: {precision: f64, rows: every}}", ekf(f64, false, 1));
    add(Some(Group::Covariance), "Kronecker factors, f32", "{kronecker: {}}", FilterParams::default());
    for (name, groups) in [("layer", Groups::Layer), ("node", Groups::Node), ("weight", Groups::Weight)] {
        let shown = if name == "weight" { "diagonal".into() } else { format!("by {name}") };
        let set = format!("{{decoupled: {{groups: {name}, precision: f64}}}}");
        add(Some(Group::Covariance), &shown, &set, decoupled(groups));
    }
    add(Some(Group::Precision), "f32", "{ekf: {precision: f32, rows: every}}", ekf(f32, false, 1));
    add(Some(Group::Precision), "UD, f64", "{ekf: {precision: f64, robust: true, rows: every}}", ekf(f64, true, 1));
    add(Some(Group::Precision), "UD, f32", "{ekf: {precision: f32, robust: true, rows: every}}", ekf(f32, true, 1));
    for batch in [8, 32] {
        let set = format!("{{ekf: {{precision: f64, batch: {batch}, rows: every}}}}");
        add(Some(Group::Batch), &format!("{batch} rows"), &set, ekf(f64, false, batch));
    }
    list
}
