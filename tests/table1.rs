//! Table 1 of Rougeron and Péroche 1997.

use haarlight::spectrum::study::table1::{Column, PRINTED, ROWS, mean_differences};
use haarlight::spectrum::study::{ColourChart, Reflectances};

fn measured(source: Reflectances) -> [Column; 3] {
    let chart = ColourChart::new(source);
    chart.lights().map(|light| Column::measure(&chart, &light))
}

#[test]
fn source_cells_are_the_printed_digits() {
    for (ours, printed) in measured(Reflectances::Babelcolor).iter().zip(&PRINTED) {
        assert_eq!(ours.source.intervals, printed.source.intervals);
        assert_eq!(
            format!("{:.4}", ours.source.xyz_error),
            format!("{:.4}", printed.source.xyz_error)
        );
        assert_eq!(
            format!("{:.2}", ours.source.luv_error),
            format!("{:.2}", printed.source.luv_error)
        );
    }
}

/// The paper's reflectances are not published, so the rows can only be near: greatest mean |measured - printed| allowed.
/// "Luv max" is the worst of up to 13 824 products and has no such limit.
#[test]
fn other_rows_are_near_the_printed_ones() {
    let limits = [
        0.10,
        0.10,
        0.05,
        f64::INFINITY,
        0.06,
        3.0,
        1.5,
        2.5,
        0.5,
        1.5,
    ];
    let differences = mean_differences(&measured(Reflectances::Babelcolor));
    for ((row, limit), difference) in ROWS.iter().zip(limits).zip(differences) {
        assert!(
            difference <= limit,
            "{row}: mean difference {difference}, at most {limit}"
        );
    }
}

/// The other chart is farther off in "none" and "measure error", and as near in the rest.
#[test]
fn the_other_chart_agrees_too() {
    let limits = [
        0.10,
        0.10,
        0.05,
        f64::INFINITY,
        0.06,
        4.0,
        1.5,
        2.5,
        0.5,
        3.0,
    ];
    let differences = mean_differences(&measured(Reflectances::Ohta));
    for ((row, limit), difference) in ROWS.iter().zip(limits).zip(differences) {
        assert!(
            difference <= limit,
            "{row}: mean difference {difference}, at most {limit}"
        );
    }
}
