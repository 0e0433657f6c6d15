//! Whether some data fits a model: what is refused, and what is told.
//!
//! In: the columns of the data and how its cells and labels were made. Out: where the inputs stand among the columns, an error where the
//! same names have another meaning, or words of warning where the model judges what it never learnt.

use super::{Model, ModelError};
use crate::cells::params::{LocalHeightParams, UnseenParams};
use crate::cells::{CellFrame, LOCAL_HEIGHT, LabelRule, is_gap};

impl Model {
    /// Where each input of the model stands among the columns of some data.
    pub(crate) fn inputs_of<S: AsRef<str>>(&self, columns: &[S]) -> Result<Vec<usize>, ModelError> {
        let place = |name: &String| columns.iter().position(|column| column.as_ref() == name);
        let missing: Vec<String> = self.about.features.iter().filter(|name| place(name).is_none()).cloned().collect();
        if !missing.is_empty() {
            return Err(ModelError::MissingFeatures { missing });
        }
        Ok(self.about.features.iter().filter_map(place).collect())
    }

    /// Refuses data whose cells have another size.
    pub(crate) fn check_cell_size(&self, data_m: f64) -> Result<(), ModelError> {
        let model_m = self.about.cells.size_m;
        if (model_m - data_m).abs() <= 1e-9 * model_m {
            return Ok(());
        }
        Err(ModelError::OtherCellSize { model_m, data_m })
    }

    /// Refuses data whose local heights, where the model takes them, mean something else.
    pub(crate) fn check_local_height(&self, data: Option<&LocalHeightParams>) -> Result<(), ModelError> {
        let takes = self.about.features.iter().any(|name| name == LOCAL_HEIGHT);
        match (&self.about.cells.local_height, data) {
            (Some(model), Some(data)) if takes && model != data => {
                Err(ModelError::OtherLocalHeight { model: model.words(), data: data.words() })
            }
            _ => Ok(()),
        }
    }

    /// Whether it judges cells that hold no point, by what the beams over them know.
    pub(crate) fn takes_unseen(&self) -> bool {
        self.about.features.iter().any(|name| is_gap(name))
    }

    /// Refuses data whose gaps, where the model takes them, mean something else.
    pub(crate) fn check_unseen(&self, data: Option<&UnseenParams>) -> Result<(), ModelError> {
        match (&self.about.cells.unseen, data) {
            (Some(model), Some(data)) if self.takes_unseen() && model != data => {
                Err(ModelError::OtherUnseen { model: model.words(), data: data.words() })
            }
            _ => Ok(()),
        }
    }

    /// What to tell where cells lie in a frame that the model never learnt from: they are judged all the same.
    pub(crate) fn other_frame(&self, data: CellFrame) -> Option<String> {
        let about = &self.about;
        let learnt = if about.frames.is_empty() { std::slice::from_ref(&about.cells.frame) } else { &about.frames };
        let names: Vec<&str> = learnt.iter().map(|frame| frame.name()).collect();
        (!learnt.contains(&data)).then(|| {
            format!(
                "the model learnt cells of the frame {}, and these are of the frame {}, in which heights, pitch and roll have other errors: \
                 expect more mistakes, or train on a corpus with `cells.frame: {}`",
                names.join(" and "),
                data.name(),
                data.name()
            )
        })
    }

    /// What to tell where cells hold what the model never learnt that they hold, or lack it: crowns, branches and gates by the rule
    /// `cells.overhang`. They are judged all the same.
    pub(crate) fn other_overhang(&self, data_m: Option<f64>) -> Option<String> {
        let about = &self.about;
        let own_m = [about.cells.above_m()];
        let learnt_m = if about.overhangs_m.is_empty() { &own_m[..] } else { &about.overhangs_m };
        let ruled = || learnt_m.iter().flatten().copied();
        let (least_m, most_m) = (ruled().fold(f64::INFINITY, f64::min), ruled().fold(f64::NEG_INFINITY, f64::max));
        let told = match data_m {
            None if learnt_m.contains(&None) => return None,
            None => format!(
                "the model learnt cells without what hangs over {least_m} m of free height, and these hold it: crowns and branches look like \
                 obstacles; build the data with the model's `cells.overhang`"
            ),
            Some(data_m) if least_m > most_m => format!(
                "the model learnt cells with all that hangs over them, and these are without what hangs over {data_m} m of free height: train on \
                 a corpus with `cells.overhang`"
            ),
            Some(data_m) if (least_m..=most_m).contains(&data_m) => return None,
            Some(data_m) => format!(
                "the model learnt cells without what hangs over {least_m} to {most_m} m of free height, and these are without what hangs over \
                 {data_m} m: train on a corpus with `cells.overhang: {{above_m: {data_m}}}`"
            ),
        };
        Some(told)
    }

    /// What to tell where a model that learnt labels by a rule of its own is judged by others (`None`: the corpus's own).
    pub(crate) fn other_labels(&self, judged_by: Option<&LabelRule>) -> Option<String> {
        let learnt = self.about.labels.as_ref().filter(|learnt| !judged_by.is_some_and(|rule| rule.same_as(learnt)))?;
        let rule = serde_json::to_string(learnt).expect("a rule is plain data");
        let by = if judged_by.is_some() { "another rule" } else { "the corpus's own labels" };
        Some(format!(
            "the model learnt labels by {rule} and is judged by {by}: --labels '{rule}' judges it by what it learnt"
        ))
    }
}
