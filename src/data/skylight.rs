//! Coefficients of the sky model of Hosek and Wilkie, "An analytic model for full spectral sky-dome radiance" (ACM Transactions on Graphics
//! 31 (4), 2012), from the table beside this file, which is under a licence of its own (`LICENSE-HOSEK-WILKIE`).
//!
//! Linear between whole turbidities and between an albedo of 0 and 1; over the height of the sun a quintic Bezier curve along the cube root of
//! its share of 90 degrees. Values have the seven digits of their authors: `f32` would do, in a third of the bytes, but can not be read.

/// Wavelengths of the model, nm.
pub(crate) const SKYLIGHT_NM: [f64; WAVES] = [
    320.0, 360.0, 400.0, 440.0, 480.0, 520.0, 560.0, 600.0, 640.0, 680.0, 720.0,
];
/// How many there are.
pub(crate) const WAVES: usize = 11;
/// A to I of the formula, and the mean radiance, W/(m2 sr nm).
pub(crate) const TERMS: usize = 10;
/// Turbidities of the model.
pub(crate) const TURBIDITY: [f64; 2] = [1.0, 10.0];
/// Control points, and how often each counts.
const POINTS: [f64; 6] = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
const CSV: &str = include_str!("hosek_wilkie.csv");

/// Terms of the formula at each wavelength; height of the sun in degrees.
///
/// # Panics
/// Turbidity, albedo or height are out of the model's range: 1 to 10, 0 to 1, 0 to 90.
pub(crate) fn skylight(turbidity: f64, albedo: f64, height: f64) -> [[f64; TERMS]; WAVES] {
    let [least, most] = TURBIDITY;
    assert!((least..=most).contains(&turbidity), "turbidity {turbidity}");
    assert!((0.0..=1.0).contains(&albedo), "albedo {albedo}");
    assert!((0.0..=90.0).contains(&height), "{height} deg");
    let (low, along) = (turbidity.floor(), (height / 90.0).cbrt());
    let share = turbidity - low;
    let mut terms = [[0.0; TERMS]; WAVES];
    // Rows go by turbidity, albedo, wavelength and point.
    let mut rows = CSV
        .lines()
        .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
    let mut row = rows
        .by_ref()
        .skip(2 * WAVES * POINTS.len() * (low as usize - 1));
    for by_turbidity in [1.0 - share, share] {
        for by_albedo in [1.0 - albedo, albedo] {
            for terms in &mut terms {
                for (k, times) in POINTS.into_iter().enumerate() {
                    // Beyond the last turbidity there is none, and its share is 0.
                    let Some(row) = row.next() else { break };
                    let power = along.powi(k as i32) * (1.0 - along).powi(5 - k as i32);
                    let weight = by_turbidity * by_albedo * times * power;
                    for (term, text) in terms.iter_mut().zip(row.split(',').skip(4)) {
                        let value: f64 = text.parse().expect("the built-in table holds numbers");
                        *term += weight * value;
                    }
                }
            }
        }
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole_and_in_order() {
        let rows = CSV.lines().filter(|l| !l.starts_with('#')).skip(1);
        let keys: Vec<Vec<f64>> = rows
            .map(|row| {
                let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
                assert_eq!(cells.len(), 4 + TERMS);
                cells[..4].to_vec()
            })
            .collect();
        assert_eq!(keys.len(), 10 * 2 * WAVES * POINTS.len());
        assert!(keys.is_sorted());
        let last = keys.last().unwrap();
        assert_eq!(last[..], [10.0, 1.0, SKYLIGHT_NM[WAVES - 1], 5.0]);
    }

    /// At both ends of its way the sun has the first and the last control point; else the mean of curves at whole turbidities.
    #[test]
    fn terms_are_those_of_the_table_and_between_them() {
        let row = |start: &str| -> Vec<f64> {
            let row = CSV.lines().find(|l| l.starts_with(start)).unwrap();
            row.split(',').skip(4).map(|c| c.parse().unwrap()).collect()
        };
        assert_eq!(skylight(1.0, 0.0, 90.0)[2][..], row("1,0,400,5,"));
        assert_eq!(skylight(10.0, 1.0, 0.0)[10][..], row("10,1,720,0,"));
        let [at, low, high] = [3.25, 3.0, 4.0].map(|t| skylight(t, 0.3, 25.0)[4][1]);
        assert!((at - (0.75 * low + 0.25 * high)).abs() < 1e-12);
        let [at, dark, bright] = [0.3, 0.0, 1.0].map(|rho| skylight(3.0, rho, 25.0)[4][1]);
        assert!((at - (0.7 * dark + 0.3 * bright)).abs() < 1e-12);
        // At an eighth of 90 degrees all points count half the fifth power by their binomials.
        let middle: f64 = (0..6)
            .map(|k| POINTS[k] / 32.0 * row(&format!("3,0,480,{k},"))[1])
            .sum();
        assert!((skylight(3.0, 0.0, 11.25)[4][1] - middle).abs() < 1e-12);
    }
}
