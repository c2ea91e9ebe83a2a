//! Panes: materials that let light straight through, as filters on rays.
//!
//! Three things make a pane: a `transmittance` of the side file (of the whole pane at normal incidence),
//! KHR_materials_transmission of at least .5, and alphaMode BLEND. KHR_materials_transmission counts times 1 - metallic, as it says, a
//! metallicRoughnessTexture by its mean: metals let nothing through.
//!
//! Glass is an absorbing slab with plane faces: both polarisations, all reflections between the faces summed (Born and Wolf,
//! Principles of Optics, 7th edition, section 14.4 without interference; the angles of ISO 9050:2003, section 5.2), see [`slab`]. With
//! KHR_materials_volume its inside absorbs along the way that light takes; without, the base colour is what one pane lets through
//! inside. A BLEND surface of alpha a and base colour c is a grid of paint: it lets through `(1 - a) (1 - a (1 - c))`, all where alpha
//! is 0, nothing where it is 1.

use super::check::{Check, listed};
use super::raw::{AlphaMode, METAL, RawMaterial, RawVolume};
use super::reader::Sampled;
use super::{Image, Surface, Texture};
use crate::color::Upsampler;
use crate::data::{BANDS, Spectrum};

/// Materials that let through less than this, by KHR_materials_transmission, are taken as opaque: most of what they do with
/// light is to scatter it.
const LEAST: f64 = 0.5;
/// Refractive index without KHR_materials_ior (its default).
const USUAL_IOR: f64 = 1.5;
/// Rough panes scatter what they let through; from here on that is said.
const ROUGH: f32 = 0.3;

/// What a material lets through.
#[derive(Debug, Clone)]
pub struct Pane {
    /// How.
    pub kind: PaneKind,
    /// Multiplies by place what passes (glass: red channel) or what covers (alpha channel).
    pub texture: Option<Texture>,
    /// Where it comes from, for `inspect`.
    pub from: String,
}

/// Kinds of panes.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum PaneKind {
    /// A slab.
    Glass {
        /// Refractive index, at least 1.
        ior: f64,
        /// What its inside lets through over the unit of its thickness, in [0, 1].
        inside: Spectrum,
        /// What thicknesses are counted in, in the file's units; none: the pane as it stands is one.
        unit: Option<f64>,
        /// Thickness of a lone face, in units.
        thickness: f64,
        /// Share of the surface that lets light through.
        share: f64,
    },
    /// A partly covered surface.
    Cover {
        /// Share that is covered.
        alpha: f64,
        /// What the paint lets through where it covers once, in [0, 1].
        colour: Spectrum,
    },
}

impl Pane {
    /// What the inside of a pane lets through over a unit of thickness, or its paint: the spectrum that [`Pane::passing`] takes.
    pub fn spectrum(&self) -> &Spectrum {
        match &self.kind {
            PaneKind::Glass { inside, .. } => inside,
            PaneKind::Cover { colour, .. } => colour,
        }
    }

    /// Transmittance at a cosine of incidence, for a thickness in units and the texture's value, as a function of what
    /// [`Pane::spectrum`] is.
    pub fn passing(&self, cosine: f64, thickness: f64, texel: f64) -> impl Fn(f64) -> f64 + use<> {
        let slab = self.slab(cosine, thickness, texel);
        let alpha = match self.kind {
            PaneKind::Glass { .. } => 0.0,
            PaneKind::Cover { alpha, .. } => (alpha * texel).clamp(0.0, 1.0),
        };
        move |spectrum| match &slab {
            Some((slab, share)) => share * slab.passes(spectrum),
            None => (1.0 - alpha) * (1.0 - alpha * (1.0 - spectrum)),
        }
    }

    /// The slab that light meets, and which share of it; none where paint covers.
    pub(crate) fn slab(&self, cosine: f64, thickness: f64, texel: f64) -> Option<(Slab, f64)> {
        match self.kind {
            PaneKind::Glass { ior, share, .. } => {
                Some((Slab::new(ior, thickness, cosine), share * texel))
            }
            PaneKind::Cover { .. } => None,
        }
    }

    /// Does it let through all wavelengths alike?
    pub fn is_neutral(&self) -> bool {
        let spectrum = self.spectrum();
        spectrum.iter().all(|x| *x == spectrum[0])
    }

    /// About what share of light it reflects at normal incidence, which is left out: glass from both faces, paint by what it covers.
    pub fn reflects(&self) -> f64 {
        match &self.kind {
            PaneKind::Glass { ior, share, .. } => {
                let r = face(*ior);
                share * (r + r * (1.0 - r) * (1.0 - r) / (1.0 - r * r))
            }
            PaneKind::Cover { alpha, colour } => {
                alpha * colour.iter().sum::<f64>() / colour.len() as f64
            }
        }
    }

    /// Transmittance by band at normal incidence of the pane as it stands.
    pub fn normal(&self) -> Spectrum {
        let thickness = match self.kind {
            PaneKind::Glass { thickness, .. } => thickness,
            PaneKind::Cover { .. } => 1.0,
        };
        self.spectrum().map(self.passing(1.0, thickness, 1.0))
    }
}

/// Transmittance of a slab for unpolarised light: `T = 1/2 sum over s, p of (1 - R)^2 a / (1 - R^2 a^2)` with Fresnel's R of one face
/// and `a = inside^(thickness / cos of refraction)`.
pub fn slab(ior: f64, inside: f64, thickness: f64, cosine: f64) -> f64 {
    Slab::new(ior, thickness, cosine).passes(inside)
}

/// A slab at one angle.
pub(crate) struct Slab {
    /// What one face reflects of each polarisation.
    pub(crate) reflected: [f64; 2],
    /// How many units of thickness light goes through; none: it gets in nowhere.
    pub(crate) way: Option<f64>,
}

impl Slab {
    pub(crate) fn new(ior: f64, thickness: f64, cosine: f64) -> Self {
        let c = cosine.clamp(0.0, 1.0);
        // Of the refracted ray: Snell's law.
        let r = (1.0 - (1.0 - c * c) / (ior * ior)).max(0.0).sqrt();
        let [s, p] = [(c - ior * r) / (c + ior * r), (ior * c - r) / (ior * c + r)];
        Self {
            reflected: [s * s, p * p],
            // Whatever numbers a file holds, a thickness is one.
            way: (c > 0.0 && r > 0.0).then_some(thickness.max(0.0) / r),
        }
    }

    pub(crate) fn passes(&self, inside: f64) -> f64 {
        let Some(way) = self.way else { return 0.0 };
        let a = match inside {
            1.0 => 1.0,
            _ => inside.powf(way),
        };
        let each = |reflected: f64| {
            if reflected >= 1.0 {
                // Along the face, as far as numbers can tell.
                return 0.0;
            }
            let once = 1.0 - reflected;
            once * once * a / (1.0 - reflected * reflected * a * a)
        };
        0.5 * (each(self.reflected[0]) + each(self.reflected[1]))
    }
}

/// Reflectance of one face at normal incidence.
fn face(ior: f64) -> f64 {
    ((ior - 1.0) / (ior + 1.0)).powi(2)
}

/// What the inside lets through of which the whole slab lets through `whole` at normal incidence: [`slab`] solved for `inside`.
pub fn inside_of(whole: f64, ior: f64) -> f64 {
    let r = face(ior);
    if whole <= 0.0 {
        return 0.0;
    }
    let b = (1.0 - r).powi(2);
    // 2 c / (b + sqrt(b^2 + 4 c r^2 whole)): the positive root of r^2 T a^2 + b a - T, without a difference of like numbers.
    (2.0 * whole / (b + (b * b + 4.0 * (r * whole).powi(2)).sqrt())).min(1.0)
}

/// The greatest index, up to `ior`, of a slab without loss inside that lets through `most` at normal incidence.
fn index_for(most: f64, ior: f64) -> f64 {
    // T = (1 - R) / (1 + R) where nothing is lost.
    let reflected = ((1.0 - most) / (1.0 + most)).max(0.0);
    if face(ior) <= reflected {
        return ior;
    }
    let root = reflected.sqrt();
    (1.0 + root) / (1.0 - root)
}

/// The materials with alphaMode BLEND only where their alpha is anywhere below 1: exporters mark whole rooms so.
pub(super) fn blended(
    materials: &[RawMaterial],
    surfaces: &[Surface],
    images: &[Image],
) -> Vec<RawMaterial> {
    let shows_through = |k: usize, raw: &RawMaterial| {
        let texture = raw.base_color_texture.as_ref();
        let image = texture.and_then(|texture| images.get(texture.image));
        let mut of = surfaces.iter().filter(|s| s.material == k);
        raw.base_color_factor[3] < 1.0
            || image.is_some_and(|image| image.pixels.iter().any(|p| p[3] < 1.0))
            || of.any(|s| s.colors.iter().flatten().any(|c| c[3] < 1.0))
    };
    let mut materials = materials.to_vec();
    for (k, raw) in materials.iter_mut().enumerate() {
        if raw.alpha_mode == AlphaMode::Blend && !shows_through(k, raw) {
            raw.alpha_mode = AlphaMode::Opaque;
        }
    }
    materials
}

/// What is said once about all panes.
#[derive(Default)]
pub(super) struct PaneNotes {
    blended: Vec<String>,
    rough: Vec<String>,
    weak: Vec<String>,
    metals: Vec<String>,
    glowing: Vec<String>,
    two: Vec<String>,
    coloured: Vec<String>,
}

impl PaneNotes {
    /// The pane that a material is, if it is one. `metallic`: the share of it that is a metal.
    #[expect(
        clippy::too_many_arguments,
        reason = "one call; each is a different thing"
    )]
    pub(super) fn pane(
        &mut self,
        (raw, metallic): (&RawMaterial, f64),
        name: &str,
        measured: Option<&Sampled>,
        emits: bool,
        place: &str,
        upsampler: &Upsampler,
        check: &mut Check,
    ) -> Option<Pane> {
        let blends = raw.alpha_mode == AlphaMode::Blend;
        let share = raw.transmission.unwrap_or(0.0) * (1.0 - metallic);
        let glass = share >= LEAST && measured.is_none();
        if raw.transmission.is_some_and(|t| t > 0.0) && !glass && measured.is_none() {
            match metallic >= f64::from(METAL) {
                true => self.metals.push(name.into()),
                false => self.weak.push(name.into()),
            }
        }
        if !(measured.is_some() || glass || blends) {
            return None;
        }
        if emits {
            self.glowing.push(name.into());
            return None;
        }
        if glass && raw.roughness.is_some_and(|r| r > ROUGH) {
            self.rough.push(name.into());
        }
        let ior = index(raw, place, check);
        let [r, g, b, alpha] = raw.base_color_factor;
        let tint = upsampler.reflectance([r, g, b].map(|c| c.min(1.0)));
        if let Some(measured) = measured {
            let most = measured.spectrum.iter().copied().fold(0.0, f64::max);
            let usual = ior;
            let ior = index_for(most, usual);
            if ior < usual {
                let clear = slab(usual, 1.0, 1.0, 1.0);
                check.warn(format!(
                    "{place}: its transmittance goes up to {most:.3}, and clear glass of index {usual:.2} lets through {clear:.3}: taken \
                     as glass of index {ior:.2}, whose faces reflect as little as coated ones"
                ));
            }
            return Some(Pane {
                kind: PaneKind::Glass {
                    ior,
                    inside: measured.spectrum.map(|t| inside_of(t, ior)),
                    unit: None,
                    thickness: 1.0,
                    share: 1.0,
                },
                texture: None,
                from: measured.from.clone(),
            });
        }
        if glass {
            if blends {
                self.two.push(name.into());
            }
            let volume = raw
                .volume
                .filter(|v| v.thickness > 0.0 && v.distance.is_some());
            let twice = |v: RawVolume| v.colour != [1.0; 3] && [r, g, b] != [1.0; 3];
            if volume.is_some_and(twice) {
                self.coloured.push(name.into());
            }
            return Some(glass_of(raw, share, ior, tint, upsampler));
        }
        self.blended.push(name.into());
        Some(Pane {
            kind: PaneKind::Cover {
                alpha: f64::from(alpha),
                colour: tint,
            },
            texture: raw.base_color_texture.clone(),
            from: format!("alphaMode BLEND, alpha {alpha:.3}"),
        })
    }

    pub(super) fn warn(&self, check: &mut Check) {
        let warnings = [
            (
                &self.blended,
                "alphaMode BLEND: panes that let through (1 - alpha) (1 - alpha (1 - base colour)); what they reflect is left out",
            ),
            (
                &self.rough,
                "rough panes: light goes straight through, as through clear ones",
            ),
            (
                &self.weak,
                "KHR_materials_transmission times 1 - metallic below 0.5: opaque, what they let through is left out",
            ),
            (
                &self.metals,
                "KHR_materials_transmission on a metal: opaque, it counts times 1 - metallic; glass has a metallicFactor of 0 (it is 1 where \
                 nothing is said)",
            ),
            (
                &self.glowing,
                "emits and lets light through: opaque, a lamp",
            ),
            (
                &self.two,
                "KHR_materials_transmission and alphaMode BLEND: taken as glass, alpha is left out",
            ),
            (
                &self.coloured,
                "KHR_materials_volume with a colour: the base colour, which would tint once more, is left out",
            ),
        ];
        for (names, what) in warnings {
            if !names.is_empty() {
                let names: Vec<String> = names
                    .iter()
                    .map(|n| format!("'{}'", super::short(n)))
                    .collect();
                check.warn(format!("{what} ({})", listed(&names)));
            }
        }
    }
}

/// The refractive index of KHR_materials_ior. 0 there stands for an infinite one, a mirror for old exporters: it is passed over.
fn index(raw: &RawMaterial, place: &str, check: &mut Check) -> f64 {
    match raw.ior {
        Some(ior) if ior != 0.0 && !(1.0..=1e3).contains(&ior) => {
            let what = format!("KHR_materials_ior: the refractive index is {ior}");
            check.problem(place, what, "give an index of at least 1; glass has 1.5");
            USUAL_IOR
        }
        Some(ior) if ior != 0.0 => ior,
        _ => USUAL_IOR,
    }
}

/// Glass by KHR_materials_transmission and KHR_materials_volume. The base colour tints once, the volume by the way.
fn glass_of(
    raw: &RawMaterial,
    share: f64,
    ior: f64,
    tint: Spectrum,
    upsampler: &Upsampler,
) -> Pane {
    let (mut inside, mut unit, mut thickness) = (tint, None, 1.0);
    let mut from = format!("transmission {share:.3}, index {ior:.3}");
    if let Some(volume) = raw.volume.filter(|v| v.thickness > 0.0) {
        // Without a distance nothing is absorbed on the way.
        let distance = volume.distance.unwrap_or(1.0);
        inside = match volume.distance {
            Some(_) => upsampler.reflectance(volume.colour),
            None => [1.0; BANDS],
        };
        // Both tints are one spectrum where the volume is plain.
        let plain = inside.iter().all(|x| *x == 1.0);
        if plain && tint.iter().any(|x| *x != 1.0) {
            inside = tint;
        } else {
            (unit, thickness) = (Some(distance), volume.thickness / distance);
            from += &format!(", volume {:.4} thick", volume.thickness);
        }
    }
    Pane {
        kind: PaneKind::Glass {
            ior,
            inside,
            unit,
            thickness,
            share,
        },
        texture: raw.transmission_texture.clone(),
        from,
    }
}

/// The value of a pane's texture at a place: alpha of paint, red of glass.
pub(crate) fn texel(pane: &Pane, images: &[Image], uv: [f32; 2]) -> f64 {
    let channel = match pane.kind {
        PaneKind::Glass { .. } => 0,
        PaneKind::Cover { .. } => 3,
    };
    let texture = pane.texture.as_ref();
    texture.map_or(1.0, |t| f64::from(t.sample(images, uv)[channel]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the whole at normal incidence to the inside and back; glass of 1.5 without loss lets through (1 - .04) / (1 + .04).
    #[test]
    fn the_inside_of_a_measured_pane() {
        for ior in [1.0, 1.33, 1.52, 2.4] {
            let most = (1.0 - face(ior)) / (1.0 + face(ior));
            for share in [0.0, 1e-6, 0.3, 0.9, 0.999] {
                let inside = inside_of(share * most, ior);
                assert!((slab(ior, inside, 1.0, 1.0) - share * most).abs() < 1e-12);
            }
            assert!((slab(ior, 1.0, 7.0, 1.0) - most).abs() < 1e-12);
        }
    }

    /// More than an index lets through means a smaller index: none for a pane that takes nothing.
    #[test]
    fn an_index_fits_what_passes() {
        assert_eq!(index_for(1.0, 1.5), 1.0);
        assert_eq!(index_for(0.9, 1.5), 1.5);
        let ior = index_for(0.95, 1.5);
        assert!(ior > 1.0 && ior < 1.5 && (slab(ior, 1.0, 1.0, 1.0) - 0.95).abs() < 1e-12);
    }

    /// Nothing passes along the face, less at a slant than across, and only numbers in [0, 1] come out.
    #[test]
    fn transmittance_falls_with_the_angle() {
        for (ior, inside) in [(1.0, 0.5), (1.5, 1.0), (1.5, 0.0), (1e3, 0.3), (1.5, 0.7)] {
            let at = |k: u32| slab(ior, inside, 1.0, f64::from(k) / 1000.0);
            assert_eq!(at(0), 0.0);
            for k in 1..=1000 {
                let t = at(k);
                assert!((0.0..=1.0).contains(&t), "{ior} {inside} {k}: {t}");
            }
            // Where indices are high a pane lets through more near Brewster's angle than across.
            assert!(ior > 2.0 || at(100) <= at(1000));
        }
        // Brewster's angle: of p nothing is reflected, of s as Fresnel has it, summed over all passes.
        let ior = 1.5_f64;
        let c = (1.0 / (1.0 + ior * ior)).sqrt();
        let r = ((1.0 - ior * ior) / (1.0 + ior * ior)).powi(2);
        let want = 0.5 * (1.0 + (1.0 - r) / (1.0 + r));
        assert!((slab(ior, 1.0, 1.0, c) - want).abs() < 1e-12);
    }

    /// Paint: all where alpha is 0, whatever its colour; nothing where it is 1.
    #[test]
    fn alpha_covers() {
        let pane = |alpha: f64| Pane {
            kind: PaneKind::Cover {
                alpha,
                colour: [0.2; BANDS],
            },
            texture: None,
            from: String::new(),
        };
        assert_eq!(pane(0.0).normal(), [1.0; BANDS]);
        assert_eq!(pane(1.0).normal(), [0.0; BANDS]);
        assert!((pane(0.5).passing(0.3, 1.0, 1.0)(0.2) - 0.5 * 0.6).abs() < 1e-12);
        assert!((pane(0.5).passing(0.3, 1.0, 0.5)(0.2) - 0.75 * 0.8).abs() < 1e-12);
    }

    fn made(change: impl FnOnce(&mut RawMaterial)) -> (Option<Pane>, String, String) {
        measured(None, change)
    }

    /// The same with what a side file says of it.
    fn measured(
        transmittance: Option<f64>,
        change: impl FnOnce(&mut RawMaterial),
    ) -> (Option<Pane>, String, String) {
        let of_file = transmittance.map(|share| Sampled {
            from: share.to_string(),
            spectrum: [share; BANDS],
            is_csv: false,
        });
        let mut raw = RawMaterial {
            index: Some(0),
            name: "glass".into(),
            metallic: 0.0,
            transmission: Some(1.0),
            ..RawMaterial::default()
        };
        change(&mut raw);
        let upsampler = Upsampler::new(&crate::data::Grid::default());
        let (mut said, mut check) = (PaneNotes::default(), Check::new("room.glb"));
        let place = "material 'glass'";
        let (of, of_file) = ((&raw, f64::from(raw.metallic)), of_file.as_ref());
        let pane = said.pane(of, "glass", of_file, false, place, &upsampler, &mut check);
        said.warn(&mut check);
        let (problems, warnings) = check.into_parts();
        let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
        (pane, problems.join("\n"), warnings.join("\n"))
    }

    #[test]
    fn what_makes_a_pane_and_what_does_not() {
        let (pane, problems, warnings) = made(|_| ());
        assert!(pane.is_some() && problems.is_empty() && warnings.is_empty());
        let (pane, _, warnings) = made(|raw| raw.transmission = Some(0.3));
        assert!(
            pane.is_none() && warnings.contains("below 0.5: opaque"),
            "{warnings}"
        );
        // Of what is in part a metal the rest lets light through; of a metal nothing.
        let (pane, _, warnings) = made(|raw| raw.metallic = 0.25);
        let share = pane.map(|pane| match pane.kind {
            PaneKind::Glass { share, .. } => share,
            PaneKind::Cover { .. } => 0.0,
        });
        assert!(
            share == Some(0.75) && warnings.is_empty(),
            "{share:?} {warnings}"
        );
        let (pane, _, warnings) = made(|raw| raw.metallic = 1.0);
        assert!(
            pane.is_none() && warnings.contains("on a metal: opaque"),
            "{warnings}"
        );
        // What a side file measures is of the whole pane, and smooth.
        let rough = |raw: &mut RawMaterial| (raw.metallic, raw.roughness) = (1.0, Some(0.9));
        let (pane, _, warnings) = measured(Some(0.8), rough);
        assert!(pane.is_some() && warnings.is_empty(), "{warnings}");
        let (_, _, warnings) = made(|raw| raw.roughness = Some(0.9));
        assert!(warnings.contains("rough panes"), "{warnings}");
        // (1 - .04) / (1 + .04) is what clear glass lets through.
        let (pane, _, warnings) = measured(Some(0.97), |_| ());
        let normal = pane.unwrap().normal()[0];
        assert!((normal - 0.97).abs() < 1e-12, "{normal}");
        for said in [
            "'glass'",
            "up to 0.970",
            "lets through 0.923",
            "of index 1.28",
        ] {
            assert!(warnings.contains(said), "{said}: {warnings}");
        }
        assert_eq!(measured(Some(0.92), |_| ()).2, "");
        let (pane, _, warnings) = made(|raw| {
            (raw.transmission, raw.alpha_mode) = (None, AlphaMode::Blend);
        });
        let pane = pane.unwrap();
        assert!(matches!(pane.kind, PaneKind::Cover { .. }));
        assert!(
            warnings.contains("(1 - alpha)") && warnings.contains("'glass'"),
            "{warnings}"
        );
        for ior in [-1.0, 0.5, 1e9] {
            let (_, problems, _) = made(|raw| raw.ior = Some(ior));
            let text = format!("the refractive index is {ior}");
            assert!(problems.contains(&text), "{problems}");
            assert!(problems.contains("material 'glass'"), "{problems}");
        }
        // 0 is what exporters write for old materials.
        let (pane, problems, _) = made(|raw| raw.ior = Some(0.0));
        assert!(pane.is_some() && problems.is_empty());
    }
}
