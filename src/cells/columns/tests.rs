use super::*;
use crate::cells::params::LocalHeightParams;

fn names(neighbours: u32, intensity: bool) -> Vec<String> {
    let params = CellParams { neighbours, ..CellParams::default() };
    feature_columns(&params, intensity).into_iter().map(|c| c.name).collect()
}

#[test]
fn golden_columns_stand_in_the_order_of_the_data_contract() {
    let expected = "mean_height_m height_variance_m2 height_difference_m point_count pitch_rad roll_rad \
        neighbour_sw_m neighbour_s_m neighbour_se_m neighbour_w_m neighbour_e_m neighbour_nw_m neighbour_n_m neighbour_ne_m \
        sigma_z_m sigma_roll_rad sigma_pitch_rad sigma_x_m sigma_y_m sigma_yaw_rad";
    assert_eq!(names(8, false).join(" "), expected);
    assert_eq!(names(8, true).join(" "), format!("{expected} intensity_mean intensity_variance"));
}

#[test]
fn golden_the_local_height_stands_between_the_neighbours_and_the_sigmas() {
    let params = CellParams { local_height: Some(LocalHeightParams::default()), ..CellParams::default() };
    let columns = feature_columns(&params, false);
    assert_eq!([13, 14, 15].map(|i| columns[i].name.as_str()), ["neighbour_ne_m", "local_height_m", "sigma_z_m"]);
    assert_eq!((columns.len(), columns[14].unit), (21, "m"));
    assert!(columns[14].description.starts_with("mean height above percentile 10 ("), "{}", columns[14].description);
    assert!(columns[14].description.contains("within 1 m,"));
}

#[test]
fn golden_the_plane_stands_behind_the_local_height() {
    let local_height = Some(LocalHeightParams { plane: true, ..LocalHeightParams::default() });
    let columns = feature_columns(&CellParams { local_height, ..CellParams::default() }, false);
    assert_eq!(
        [14, 15, 16, 17].map(|i| columns[i].name.as_str()),
        [LOCAL_HEIGHT, PLANE_HEIGHT, PLANE_SLOPE, "sigma_z_m"]
    );
}

#[test]
fn golden_the_columns_of_gaps_stand_last_and_a_drop_is_a_truth_of_its_own() {
    let params = CellParams { unseen: Some(Default::default()), ..CellParams::default() };
    let columns = feature_columns(&params, true);
    assert_eq!(
        (columns.len(), columns[22].name.as_str(), columns[37].name.as_str()),
        (38, "gap_length_m", "gap_right_m")
    );
    assert!(columns.iter().skip(22).all(|column| is_gap(&column.name)) && !is_gap("point_count"));
    assert!(truth_columns(&params).is_empty());
    let labels = crate::cells::params::LabelParams { max_drop_m: Some(0.2), ..params.labels.clone() };
    assert_eq!(
        truth_columns(&CellParams { labels, ..params }).iter().map(|c| c.name).collect::<Vec<_>>().join(" "),
        "truth_drop_m truth_pit_m"
    );
}

#[test]
fn exact_four_and_twenty_four_neighbours_are_named_by_compass() {
    assert_eq!(names(4, false)[6..10].join(" "), "neighbour_s_m neighbour_w_m neighbour_e_m neighbour_n_m");
    let far: Vec<String> = neighbour_offsets(24).into_iter().map(Offset::name).collect();
    assert_eq!(far.join(" "), "ssww ssw ss sse ssee sww sw s se see ww w e ee nww nw n ne nee nnww nnw nn nne nnee");
}
