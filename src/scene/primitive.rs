//! One primitive of a mesh, read and checked, in its own space: vertices and a list of triangles
//! (glTF 2.0, section 3.7.2).

use crate::scene::accessor::Accessors;
use crate::scene::check::Check;
use crate::scene::components::to_vectors;
use crate::scene::compression::{self, DracoMesh, Unpacked};
use crate::scene::json::Item;
use gltf::json::buffer::View;
use gltf::json::mesh::{self, Mode, Semantic};
use gltf::json::validation::Checked::{self, Invalid, Valid};
use gltf::json::{Accessor, Index};
use serde::Deserialize;
use std::collections::BTreeMap;

const AGAIN: &str = "export the file again";
/// Texture coordinate sets that are read; more are left out with a warning.
pub(crate) const MAX_TEXCOORDS: usize = 8;

/// A primitive before it is placed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Primitive {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Option<Vec<[f32; 3]>>,
    pub(crate) texcoords: Vec<Vec<[f32; 2]>>,
    pub(crate) colors: Option<Vec<[f32; 4]>>,
    /// Every index is below the number of positions.
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Primitive {
    /// The greater of the numbers of vertices and triangles (a strip has up to as many triangles as vertices, a list
    /// seldom more than twice).
    pub(crate) fn size(&self) -> usize {
        self.positions.len().max(self.triangles.len() / 2)
    }
}

/// What became of a primitive.
#[derive(Debug, Clone)]
pub(crate) enum Outcome {
    /// It is sound.
    Sound(Primitive),
    /// Points or lines: nothing that reflects light.
    NoArea,
    /// Something is wrong with it, and was reported.
    Bad,
}

/// Vertices and corners of triangles that a primitive claims to have, read off its accessors' counts without
/// reading them.
pub(crate) fn claimed(item: &Item<'_>, accessors: &Accessors<'_>) -> (usize, usize) {
    // What is broken is reported when it is read.
    let mut silent = Check::new("");
    let Some(given) = item.read::<mesh::Primitive>(&mut silent) else {
        return (0, 0);
    };
    let mut count = |accessor: Option<Index<Accessor>>| {
        let layout = accessor.and_then(|a| accessors.layout(a.value(), "", &mut silent));
        layout.map(|(_, layout)| layout.count)
    };
    let position = given.attributes.get(&Valid(Semantic::Positions));
    let vertices = count(position.copied()).unwrap_or(0);
    let corners = count(given.indices).unwrap_or(vertices);
    (vertices, corners)
}

/// Reads a primitive; `most` bounds the vertices and triangles that a packed one may unpack to.
pub(crate) fn read(
    item: &Item<'_>,
    given: &mesh::Primitive,
    accessors: &mut Accessors<'_>,
    most: usize,
    check: &mut Check,
) -> Outcome {
    let mode = match given.mode {
        Valid(Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) => {
            return Outcome::NoArea;
        }
        Valid(mode) => mode,
        Invalid => {
            let what = format!("has the mode {}", item.said("mode"));
            check.problem(&item.place, what, AGAIN);
            return Outcome::Bad;
        }
    };
    match checked(item, given, mode, accessors, most, check) {
        Some(primitive) => Outcome::Sound(primitive),
        None => Outcome::Bad,
    }
}

fn checked(
    item: &Item<'_>,
    given: &mesh::Primitive,
    mode: Mode,
    accessors: &mut Accessors<'_>,
    most: usize,
    check: &mut Check,
) -> Option<Primitive> {
    let Some(position) = given.attributes.get(&Valid(Semantic::Positions)) else {
        check.problem(&item.place, "has no POSITION", AGAIN);
        return None;
    };
    let packed = match draco(item, *position, accessors, most, check) {
        Ok(packed) => packed,
        Err(Reported) => return None,
    };
    let mut vertices = Vertices {
        place: &item.place,
        attributes: &given.attributes,
        packed: packed.as_ref(),
        accessors,
        check,
    };
    let positions = vertices.read::<3>(Semantic::Positions, *position, None)?;
    if let Some(index) = positions
        .iter()
        .position(|p| !p.iter().all(|x| x.is_finite()))
    {
        let place = format!("{}, POSITION", item.place);
        let what = format!("has a position that is not finite, at vertex {index}");
        vertices.check.problem(&place, what, AGAIN);
        return None;
    }
    let count = positions.len();
    let normals = vertices.optional::<3>(Semantic::Normals, count)?;
    let colors = vertices.colors(count)?;
    let mut texcoords = Vec::new();
    for set in (0..).take(MAX_TEXCOORDS) {
        match vertices.optional::<2>(Semantic::TexCoords(set), count)? {
            Some(set) => texcoords.push(set),
            None => break,
        }
    }
    let triangles = match &packed {
        // Draco always gives a plain list.
        Some(mesh) => corners(&mesh.indices, Mode::Triangles, count, item, check)?,
        None => {
            let indices = match given.indices {
                Some(accessor) => {
                    let place = format!("{}, indices", item.place);
                    accessors.indices(accessor.value(), &place, check)?
                }
                None if item.has("indices") => return None,
                None => (0..u32::try_from(count).unwrap_or(0)).collect(),
            };
            corners(&indices, mode, count, item, check)?
        }
    };
    let mut primitive = Primitive {
        positions,
        normals,
        texcoords,
        colors,
        triangles,
    };
    mend(&mut primitive, item, check);
    Some(primitive)
}

/// Triangles of so many vertices, made sure to name no others.
fn corners(
    indices: &[u32],
    mode: Mode,
    count: usize,
    item: &Item<'_>,
    check: &mut Check,
) -> Option<Vec<[u32; 3]>> {
    let place = &item.place;
    if let Some(at) = indices.iter().position(|&i| i as usize >= count) {
        let index = indices[at];
        let what = format!("index {at} is {index}, but there are {count} vertices");
        check.problem(&format!("{place}, indices"), what, AGAIN);
        return None;
    }
    if mode == Mode::Triangles && !indices.len().is_multiple_of(3) {
        let left = indices.len() % 3;
        check.warn(format!(
            "{place}: {left} indices beyond the last triangle are left out"
        ));
    }
    Some(triangles(indices, mode))
}

/// The problem was put on the list.
struct Reported;

/// The unpacked Draco stream, if the primitive has one.
fn draco(
    item: &Item<'_>,
    position: Index<Accessor>,
    accessors: &mut Accessors<'_>,
    most: usize,
    check: &mut Check,
) -> Result<Option<DracoMesh>, Reported> {
    let Some(extension) = item.extended(compression::DRACO, check) else {
        return Ok(None);
    };
    if !compression::is_built_in(compression::DRACO) {
        // The accessors may have plain bytes too.
        let place = format!("{}, POSITION", item.place);
        let layout = accessors.layout(position.value(), &place, check);
        if !layout.ok_or(Reported)?.0.is_bare {
            return Ok(None);
        }
        let what = format!("needs {}, which this build leaves out", compression::DRACO);
        check.problem(&item.place, what, "export without this compression");
        return Err(Reported);
    }
    let DracoView { buffer_view } = item.extension(compression::DRACO, check).ok_or(Reported)?;
    let place = format!("{}, {}", item.place, compression::DRACO);
    let span = accessors.views.view(buffer_view.value(), &place, check);
    let span = span.ok_or(Reported)?;
    // By name: a stream may hold attributes that the standard has no word for.
    let attributes = item.child("attributes", check).ok_or(Reported)?;
    let attributes = attributes.read::<BTreeMap<String, Index<Accessor>>>(check);
    let mut counts = Vec::new();
    for (semantic, index) in attributes.ok_or(Reported)? {
        let place = format!("{}, {semantic}", item.place);
        let layout = accessors.layout(index.value(), &place, check);
        let (_, layout) = layout.ok_or(Reported)?;
        counts.push((semantic, layout.count, layout.normalized));
    }
    let extension_value = serde_json::Value::Object(extension.map.clone());
    compression::unpack_draco(span.bytes(), &extension_value, &counts, most)
        .map(Some)
        .map_err(|what| {
            check.problem(&place, what, "export without this compression");
            Reported
        })
}

/// Where KHR_draco_mesh_compression has its bytes; the rest of it is the decoder's.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct DracoView {
    buffer_view: Index<View>,
}

/// The attributes of one primitive, packed or plain.
struct Vertices<'a, 'b> {
    place: &'a str,
    attributes: &'a BTreeMap<Checked<Semantic>, Index<Accessor>>,
    packed: Option<&'a DracoMesh>,
    accessors: &'a mut Accessors<'b>,
    check: &'a mut Check,
}

impl<'a> Vertices<'a, '_> {
    /// What Draco unpacked under a name.
    fn unpacked(&self, semantic: &str) -> Option<&'a Unpacked> {
        let attributes = &self.packed?.attributes;
        let found = attributes.iter().find(|(name, _)| name == semantic);
        found.map(|(_, plain)| plain)
    }

    fn read<const N: usize>(
        &mut self,
        semantic: Semantic,
        accessor: Index<Accessor>,
        count: Option<usize>,
    ) -> Option<Vec<[f32; N]>> {
        let semantic = &semantic.to_string();
        let place = format!("{}, {semantic}", self.place);
        if let Some(plain) = self.unpacked(semantic) {
            if plain.width == N {
                return Some(to_vectors(&plain.bytes, plain.component, plain.normalized));
            }
            let what = format!("has {} components an element, not {N}", plain.width);
            self.check.problem(&place, what, AGAIN);
            return None;
        }
        self.accessors
            .vectors(accessor.value(), count, &place, self.check)
    }

    /// The inner none: the primitive does not have it; the outer one: it is broken, which was reported.
    fn optional<const N: usize>(
        &mut self,
        semantic: Semantic,
        count: usize,
    ) -> Option<Option<Vec<[f32; N]>>> {
        let place = format!("{}, {}", self.place, semantic.to_string());
        let Some(accessor) = self.attributes.get(&Valid(semantic.clone())) else {
            return Some(None);
        };
        let values = self.read::<N>(semantic, *accessor, Some(count))?;
        if values.len() == count {
            return Some(Some(values));
        }
        // Only what Draco unpacked can come here.
        let what = format!("has {} elements for {count} vertices", values.len());
        self.check.problem(&place, what, AGAIN);
        None
    }

    /// COLOR_0, of three or four components.
    fn colors(&mut self, count: usize) -> Option<Option<Vec<[f32; 4]>>> {
        const NAME: &str = "COLOR_0";
        let semantic = Semantic::Colors(0);
        let Some(accessor) = self.attributes.get(&Valid(semantic.clone())) else {
            return Some(None);
        };
        let width = match self.unpacked(NAME) {
            Some(plain) => plain.width,
            None => {
                let place = format!("{}, {NAME}", self.place);
                let layout = self
                    .accessors
                    .layout(accessor.value(), &place, self.check)?;
                layout.1.width
            }
        };
        if width == 4 {
            return self.optional::<4>(semantic, count);
        }
        let rgb = self.optional::<3>(semantic, count)?;
        Some(rgb.map(|rgb| rgb.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()))
    }
}

/// The corners of a list, strip or fan, in the standard's order (section 3.7.2.1), all turned the same way.
fn triangles(indices: &[u32], mode: Mode) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turn = |(i, c): (usize, &[u32])| {
                if i % 2 == 0 {
                    [c[0], c[1], c[2]]
                } else {
                    [c[0], c[2], c[1]]
                }
            };
            indices.windows(3).enumerate().map(turn).collect()
        }
        Mode::TriangleFan => match indices {
            [hub, rim @ ..] => rim.windows(2).map(|c| [c[0], c[1], *hub]).collect(),
            [] => Vec::new(),
        },
        _ => indices
            .chunks_exact(3)
            .map(|c| [c[0], c[1], c[2]])
            .collect(),
    }
}

/// Replaces what is not finite among texture coordinates and colours, and says how often; coordinates and colours
/// cannot spoil more than paint.
fn mend(primitive: &mut Primitive, item: &Item<'_>, check: &mut Check) {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for value in primitive.texcoords.iter_mut().flatten().flatten() {
        if !value.is_finite() {
            *value = 0.0;
            *counts.entry("texture coordinates").or_default() += 1;
        }
    }
    for value in primitive.colors.iter_mut().flatten().flatten() {
        if !value.is_finite() || *value < 0.0 {
            *value = if *value < 0.0 { 0.0 } else { 1.0 };
            *counts.entry("vertex colours").or_default() += 1;
        }
    }
    for (what, count) in counts {
        let place = &item.place;
        check.warn(format!(
            "{place}: {count} numbers of {what} are out of range and were replaced"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_turn_as_the_standard_says() {
        assert_eq!(
            triangles(&[5, 6, 7, 8, 9], Mode::TriangleStrip),
            [[5, 6, 7], [6, 8, 7], [7, 8, 9]]
        );
        assert_eq!(
            triangles(&[5, 6, 7, 8], Mode::TriangleFan),
            [[6, 7, 5], [7, 8, 5]]
        );
        assert_eq!(triangles(&[0, 1, 2, 3, 4], Mode::Triangles), [[0, 1, 2]]);
        for mode in [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan] {
            for length in 0..3 {
                assert!(triangles(&[0, 1, 2][..length], mode).is_empty());
            }
        }
    }
}
