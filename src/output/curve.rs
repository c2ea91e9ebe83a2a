//! From linear light to what a display can show: one curve for all channels together, so that bright light keeps its hue
//! and ends in white.
//!
//! With p the strongest channel: colours with p up to `KNEE` stay what they are. Above, the colour is scaled so that p
//! becomes `1 - d^2 / (p + d - KNEE)`, d = 1 - KNEE (continuous with its slope, below 1 for any p), and mixed with white
//! of that strength, more the more was taken away. It is the upper part of Khronos' PBR Neutral tone mapper (2024), with
//! its constants; the darkening of what reflects at grazing angles is left out.
//! Colours outside of sRGB are first mixed with their grey until no channel is below 0.

/// Up to here colours are shown as they are.
pub(crate) const KNEE: f64 = 0.8;
/// How fast what is too bright turns white.
const DESATURATION: f64 = 0.15;
/// Luminance weights of linear sRGB (IEC 61966-2-1, ITU-R BT.709 primaries).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// What a display shows of linear sRGB with white at 1: in [0, 1].
pub(crate) fn into_display(rgb: [f64; 3]) -> [f64; 3] {
    let rgb = into_gamut(rgb);
    let peak = strongest(rgb);
    if peak <= KNEE {
        return rgb;
    }
    let room = 1.0 - KNEE;
    let shown = 1.0 - room * room / (peak + room - KNEE);
    let white = 1.0 - 1.0 / (DESATURATION * (peak - shown) + 1.0);
    // An infinite light is white.
    rgb.map(|c| match peak.is_finite() {
        true => (shown * (c / peak * (1.0 - white) + white)).clamp(0.0, 1.0),
        false => 1.0,
    })
}

/// Does the curve change this colour?
pub(crate) fn is_compressed(rgb: [f64; 3]) -> bool {
    strongest(rgb) > KNEE
}

/// The strongest channel.
pub(crate) fn strongest(rgb: [f64; 3]) -> f64 {
    rgb.into_iter().fold(0.0, f64::max)
}

/// Mixed with its grey, which keeps luminance, until no channel is below 0; black without luminance.
pub(crate) fn into_gamut(rgb: [f64; 3]) -> [f64; 3] {
    let least = rgb.into_iter().fold(0.0, f64::min);
    if least >= 0.0 && !rgb.iter().any(|c| c.is_nan()) {
        return rgb;
    }
    let grey: f64 = rgb.iter().zip(LUMINANCE).map(|(c, w)| c * w).sum();
    if grey <= 0.0 || !grey.is_finite() {
        return [0.0; 3];
    }
    let keep = grey / (grey - least);
    rgb.map(|c| (grey + keep * (c - grey)).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn colours_below_the_knee_are_left_alone() {
        assert_eq!(into_display([0.2, 0.5, 0.8]), [0.2, 0.5, 0.8]);
        assert_eq!(into_display([f64::NAN, 0.5, 0.8]), [0.0; 3]);
        assert_eq!(into_display([f64::INFINITY, 0.5, 0.8]), [1.0; 3]);
        assert!(into_display([1e9; 3]).iter().all(|&c| c > 0.999_999));
    }

    #[test]
    fn what_is_outside_of_the_gamut_keeps_its_luminance() {
        let outside = [-0.2, 0.5, 0.1];
        let y = |c: [f64; 3]| c.iter().zip(LUMINANCE).map(|(c, w)| c * w).sum::<f64>();
        let shown = into_display(outside);
        assert!((y(shown) - y(outside)).abs() < 1e-12 && shown[0].abs() < 1e-12);
    }

    /// Where a colour lies between its least and its strongest channel: its hue.
    fn hue([a, b, c]: [f64; 3]) -> f64 {
        (b - a) / (c - a)
    }

    proptest! {
        #[test]
        fn brighter_is_brighter_of_the_same_hue_and_whiter(
            low in 0.0..0.5f64, mid in 0.5..0.9f64, light in 0.1..100.0f64, more in 1.01..10.0f64,
        ) {
            let at = |light: f64| into_display([low * light, mid * light, light]);
            let (one, two) = (at(light), at(more * light));
            prop_assert!(two[2] > one[2] && two[2] <= 1.0);
            prop_assert!((hue(one) - hue([low, mid, 1.0])).abs() < 1e-9);
            prop_assert!((hue(two) - hue([low, mid, 1.0])).abs() < 1e-9);
            prop_assert!(two[0] / two[2] >= one[0] / one[2] - 1e-12);
        }
    }
}
