//! Where pictures are taken from: the file's cameras, else one of our own.
//!
//! A view maps a world point to homogeneous pixel coordinates (X, Y, W): the pixel is (X / W, Y / W), y down from the
//! top; W is the distance along the view for a perspective and 1 for an orthographic projection.

use super::default_view::{self, DefaultView};
use crate::scene::{Camera, Projection, Scene};
use glam::{DMat4, DVec3};

/// Nearest drawn distance as a share of the room's diagonal.
const NEAR: f64 = 1e-4;

/// Vertical field of view of our own camera inside the room, radians: a wide lens, 24 mm on film.
const INSIDE_VIEW: f64 = 1.2;
/// The same outside, looking in through an open or culled wall.
const OUTSIDE_VIEW: f64 = 0.69;
/// Distance of a camera in a corner from the walls, as a share of the room.
const INSET: f64 = 0.08;
/// Height of a camera in a corner, as a share of the room's.
const EYE_HEIGHT: f64 = 0.72;
/// Room left around the opening that an outside camera looks through.
const MARGIN: f64 = 1.06;

/// A camera with a picture format.
#[derive(Debug, Clone)]
pub struct View {
    to_camera: DMat4,
    perspective: bool,
    /// Half width and half height: tangents, or lengths for an orthographic view.
    half: [f64; 2],
    pixels: [f64; 2],
    /// Nearest drawn distance, the file's units.
    near: f64,
    to_world: DMat4,
}

/// A projected point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projected {
    /// Homogeneous pixel coordinates.
    pub(super) pixel: DVec3,
    /// Distance along the view, the file's units.
    pub(super) depth: f64,
}

impl View {
    /// What `camera` sees in a picture of `width` by `height` pixels. A picture narrower than the camera's own format
    /// keeps the camera's width, so that what it was made to show stays in sight.
    pub fn new(scene: &Scene, camera: &Camera, width: usize, height: usize) -> Self {
        let picture = width as f64 / height as f64;
        let (perspective, mut half_height) = match camera.projection {
            Projection::Perspective(angle) => (true, (0.5 * angle).tan()),
            Projection::Orthographic(half) => (false, half),
        };
        if let Some(aspect) = camera.aspect
            && picture < aspect
        {
            half_height *= aspect / picture;
        }
        // A camera under a scaled node still has a rigid view (glTF 2.0, section 3.10.1).
        let axis = |column: usize| camera.to_world.col(column).truncate().normalize_or_zero();
        let rigid = DMat4::from_cols(
            axis(0).extend(0.0),
            axis(1).extend(0.0),
            axis(2).extend(0.0),
            camera.to_world.w_axis,
        );
        Self {
            to_camera: rigid.inverse(),
            to_world: rigid,
            perspective,
            half: [half_height * picture, half_height],
            pixels: [width as f64, height as f64],
            near: NEAR * Bounds::of(scene).diagonal(),
        }
    }

    pub(super) fn near(&self) -> f64 {
        self.near
    }

    /// Unit vector along which a place of the picture is looked at, in pixels from its upper left corner.
    pub(super) fn direction(&self, [x, y]: [f64; 2]) -> DVec3 {
        let across = self.half[0] * (2.0 * x / self.pixels[0] - 1.0);
        let up = self.half[1] * (1.0 - 2.0 * y / self.pixels[1]);
        let ahead = match self.perspective {
            true => DVec3::new(across, up, -1.0),
            false => DVec3::NEG_Z,
        };
        self.to_world.transform_vector3(ahead).normalize()
    }

    pub(super) fn project(&self, point: DVec3) -> Projected {
        let p = self.to_camera.transform_point3(point);
        let depth = -p.z;
        let w = if self.perspective { depth } else { 1.0 };
        let x = 0.5 * self.pixels[0] * (w + p.x / self.half[0]);
        let y = 0.5 * self.pixels[1] * (w - p.y / self.half[1]);
        Projected {
            pixel: DVec3::new(x, y, w),
            depth,
        }
    }
}

/// The file's cameras; some of our own if it has none: see [`own`].
pub fn cameras(scene: &Scene) -> Vec<Camera> {
    if scene.cameras.is_empty() {
        own(scene)
    } else {
        scene.cameras.clone()
    }
}

/// Cameras of our own: in the largest lit space with a view over it, in further spaces, or outside, looking in through an
/// open or culled side, if that shows more. At least one; the best comes first.
pub fn own(scene: &Scene) -> Vec<Camera> {
    let bounds = Bounds::of(scene);
    let views = default_view::views(scene, INSIDE_VIEW, &candidates(&bounds));
    let mut cameras: Vec<Camera> = (views.iter().enumerate())
        .map(|(k, view)| Camera {
            name: match k {
                0 => "view".into(),
                k => format!("view {}", k + 1),
            },
            ..looking(view.eye, view.target, view.angle)
        })
        .collect();
    if cameras.is_empty() {
        let target = bounds.centre();
        cameras.push(looking(
            target + bounds.diagonal() * DVec3::Z,
            target,
            OUTSIDE_VIEW,
        ));
    }
    cameras
}

/// Cameras that show a room whatever its light: from outside, +z (towards the viewer in glTF) before the others, and from
/// the corners.
fn candidates(bounds: &Bounds) -> Vec<DefaultView> {
    let (centre, size) = (bounds.centre(), bounds.size());
    let mut views = Vec::new();
    for side in [DVec3::Z, DVec3::X, DVec3::NEG_X, DVec3::NEG_Z] {
        let across = if side.x == 0.0 { size.x } else { size.z };
        let tangent = (0.5 * OUTSIDE_VIEW).tan();
        // Far enough that the nearest face of the bounds fits, in a picture of 4 by 3.
        let distance = MARGIN * (0.5 * size.y).max(0.5 * across * 0.75) / tangent;
        let depth = 0.5 * (size * side).length();
        views.push(DefaultView {
            eye: centre + side * (depth + distance),
            target: centre,
            angle: OUTSIDE_VIEW,
        });
    }
    for (x, z) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        let offset = DVec3::new(x * (0.5 - INSET), EYE_HEIGHT - 0.5, z * (0.5 - INSET)) * size;
        views.push(DefaultView {
            eye: centre + offset,
            // Down a little, to the middle of the floor's half of the room.
            target: centre - DVec3::new(0.0, 0.12 * size.y, 0.0),
            angle: INSIDE_VIEW,
        });
    }
    views
}

fn looking(eye: DVec3, target: DVec3, angle: f64) -> Camera {
    let back = (eye - target).normalize_or(DVec3::Z);
    let right = DVec3::Y.cross(back).normalize_or(DVec3::X);
    let up = back.cross(right);
    Camera {
        name: "view".into(),
        to_world: DMat4::from_cols(
            right.extend(0.0),
            up.extend(0.0),
            back.extend(0.0),
            eye.extend(1.0),
        ),
        projection: Projection::Perspective(angle),
        aspect: None,
    }
}

/// The box around all surfaces.
struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    fn of(scene: &Scene) -> Self {
        let points = scene.surfaces.iter().flat_map(|s| {
            s.triangles
                .iter()
                .flatten()
                .map(|&c| s.positions[c as usize])
        });
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = points.fold(start, |(low, high), p| (low.min(p), high.max(p)));
        if low.x <= high.x {
            Self { low, high }
        } else {
            Self {
                low: DVec3::NEG_ONE,
                high: DVec3::ONE,
            }
        }
    }

    fn centre(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    fn size(&self) -> DVec3 {
        self.high - self.low
    }

    fn diagonal(&self) -> f64 {
        self.size().length().max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_camera_is_a_right_handed_frame_that_looks_at_its_target() {
        let camera = looking(DVec3::new(3.0, 2.0, 1.0), DVec3::ZERO, 1.0);
        assert!((camera.to_world.determinant() - 1.0).abs() < 1e-12);
        let ahead = camera.to_world.transform_vector3(DVec3::NEG_Z);
        assert!((ahead - DVec3::new(-3.0, -2.0, -1.0).normalize()).length() < 1e-12);
    }
}
