//! Where the sun stands.

use chrono::{DateTime, FixedOffset};
use glam::DVec3;
use solar_positioning::{Location, SolarPositions, delta_t};

/// A moment, with its distance from universal time.
pub type Hours = DateTime<FixedOffset>;

/// The direction toward a place in the sky, degrees: height above the horizon, and azimuth from north (-Z) over east (+X).
pub fn direction(elevation: f64, azimuth: f64) -> DVec3 {
    let (up, level) = elevation.to_radians().sin_cos();
    let (east, north) = azimuth.to_radians().sin_cos();
    DVec3::new(level * east, up, -level * north)
}

/// Height and azimuth of a direction, degrees; the other way round.
pub(super) fn angles(direction: DVec3) -> [f64; 2] {
    let azimuth = direction.x.atan2(-direction.z).to_degrees();
    [
        direction.y.clamp(-1.0, 1.0).asin().to_degrees(),
        azimuth.rem_euclid(360.0),
    ]
}

/// Height and azimuth of the sun, degrees: the algorithm of Reda and Andreas 2004, at sea level, without refraction.
///
/// # Errors
/// In words: no such place, or a time out of its range.
pub(super) fn position(latitude: f64, longitude: f64, time: &Hours) -> Result<[f64; 2], String> {
    let place = Location {
        latitude,
        longitude,
    };
    let seconds = delta_t::estimate_from_date_like(time).map_err(|e| e.to_string())?;
    let sun = SolarPositions::new()
        .at(time, place, 0.0, seconds, None)
        .map_err(|e| e.to_string())?;
    Ok([sun.elevation_angle(), sun.azimuth()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_follow_the_compass() {
        let near = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-12, "{a} {b}");
        near(direction(0.0, 0.0), DVec3::NEG_Z);
        near(direction(0.0, 90.0), DVec3::X);
        near(direction(0.0, 180.0), DVec3::Z);
        near(direction(90.0, 12.0), DVec3::Y);
        let [h, a] = angles(direction(33.0, 250.0));
        assert!((h - 33.0).abs() < 1e-9 && (a - 250.0).abs() < 1e-9);
    }

    /// Reda and Andreas 2004, appendix A.5: 17 October 2003, 12:30:30 at -7 h, 39.742476 N, 105.1786 W: zenith angle 50.11162 at
    /// 1830 m and with refraction, azimuth 194.34024.
    #[test]
    fn the_sun_stands_where_the_paper_says() {
        let time = "2003-10-17T12:30:30-07:00".parse().unwrap();
        let [h, a] = position(39.742_476, -105.178_6, &time).unwrap();
        assert!((h - (90.0 - 50.111_62)).abs() < 0.02, "{h}");
        assert!((a - 194.340_24).abs() < 0.002, "{a}");
        assert!(position(91.0, 0.0, &time).is_err());
    }
}
