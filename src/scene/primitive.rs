//! One primitive of a mesh, read and checked, in its own space: vertices and a list of triangles
//! (glTF 2.0, section 3.7.2).

use crate::scene::accessor::{Accessors, to_vectors};
use crate::scene::check::Check;
use crate::scene::compression::{self, DracoMesh};
use crate::scene::json::Item;
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

/// `mode` of a primitive that has an area.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Triangles,
    Strip,
    Fan,
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
    // A broken accessor is reported when it is read.
    let mut silent = Check::new("");
    let attributes = item.child("attributes", &mut silent);
    let position = attributes.and_then(|a| a.index("POSITION", &mut silent));
    let mut count = |accessor: Option<usize>| {
        let layout = accessor.and_then(|a| accessors.layout(a, "", &mut silent));
        layout.map(|(_, layout)| layout.count)
    };
    let vertices = count(position).unwrap_or(0);
    let mut quiet = Check::new("");
    let corners = count(item.index("indices", &mut quiet)).unwrap_or(vertices);
    (vertices, corners)
}

/// Reads a primitive; `most` bounds the vertices and triangles that a packed one may unpack to.
pub(crate) fn read(
    item: &Item<'_>,
    accessors: &mut Accessors<'_>,
    most: usize,
    check: &mut Check,
) -> Outcome {
    let mode = match item.index("mode", check) {
        None | Some(4) => Mode::Triangles,
        Some(5) => Mode::Strip,
        Some(6) => Mode::Fan,
        Some(0..=3) => return Outcome::NoArea,
        Some(other) => {
            check.problem(&item.place, format!("has the mode {other}"), AGAIN);
            return Outcome::Bad;
        }
    };
    match checked(item, mode, accessors, most, check) {
        Some(primitive) => Outcome::Sound(primitive),
        None => Outcome::Bad,
    }
}

fn checked(
    item: &Item<'_>,
    mode: Mode,
    accessors: &mut Accessors<'_>,
    most: usize,
    check: &mut Check,
) -> Option<Primitive> {
    let attributes = item.child("attributes", check);
    let Some(attributes) = attributes.filter(|a| a.map.contains_key("POSITION")) else {
        check.problem(&item.place, "has no POSITION", AGAIN);
        return None;
    };
    let packed = match draco(item, &attributes, accessors, most, check) {
        Ok(packed) => packed,
        Err(Reported) => return None,
    };
    let mut vertices = Vertices {
        attributes: &attributes,
        unpacked: packed.as_ref(),
        accessors,
        check,
    };
    let positions = vertices.read::<3>("POSITION", None)?;
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
    let normals = vertices.optional::<3>("NORMAL", count)?;
    let colors = vertices.colors(count)?;
    let mut texcoords = Vec::new();
    while texcoords.len() < MAX_TEXCOORDS {
        match vertices.optional::<2>(&format!("TEXCOORD_{}", texcoords.len()), count)? {
            Some(set) => texcoords.push(set),
            None => break,
        }
    }
    let indices = match &packed {
        Some(mesh) => Some(mesh.indices.clone()),
        None if item.map.contains_key("indices") => {
            let place = format!("{}, indices", item.place);
            let accessor = item.index("indices", check)?;
            Some(accessors.indices(accessor, &place, check)?)
        }
        None => None,
    };
    // Draco always gives a plain list.
    let mode = if packed.is_some() {
        Mode::Triangles
    } else {
        mode
    };
    let indices = indices.unwrap_or_else(|| (0..u32::try_from(count).unwrap_or(0)).collect());
    if let Some(at) = indices.iter().position(|&i| i as usize >= count) {
        let what = format!(
            "index {at} is {}, but there are {count} vertices",
            indices[at]
        );
        check.problem(&format!("{}, indices", item.place), what, AGAIN);
        return None;
    }
    if mode == Mode::Triangles && indices.len() % 3 != 0 {
        let left = indices.len() % 3;
        check.warn(format!(
            "{}: {left} indices beyond the last triangle are left out",
            item.place
        ));
    }
    let mut primitive = Primitive {
        positions,
        normals,
        texcoords,
        colors,
        triangles: triangles(&indices, mode),
    };
    mend(&mut primitive, item, check);
    Some(primitive)
}

/// The problem was put on the list.
struct Reported;

/// The unpacked Draco stream, if the primitive has one.
fn draco(
    item: &Item<'_>,
    attributes: &Item<'_>,
    accessors: &mut Accessors<'_>,
    most: usize,
    check: &mut Check,
) -> Result<Option<DracoMesh>, Reported> {
    let Some(mut extension) = item.extension(compression::DRACO, check) else {
        return Ok(None);
    };
    if !compression::is_built_in(compression::DRACO) {
        // Not required, or the document would have been refused: the accessors have plain bytes too.
        return Ok(None);
    }
    extension.place = format!("{}, {}", item.place, compression::DRACO);
    let Some(view) = extension.index("bufferView", check) else {
        check.problem(&extension.place, "names no bufferView", AGAIN);
        return Err(Reported);
    };
    let span = accessors
        .views
        .view(view, &extension.place, check)
        .ok_or(Reported)?;
    let mut counts = Vec::new();
    for semantic in attributes.map.keys() {
        let Some(index) = attributes.index(semantic, check) else {
            return Err(Reported);
        };
        let place = format!("{}, {semantic}", item.place);
        let (_, layout) = accessors.layout(index, &place, check).ok_or(Reported)?;
        counts.push((semantic.clone(), layout.count, layout.normalized));
    }
    let extension_value = serde_json::Value::Object(extension.map.clone());
    compression::unpack_draco(span.bytes(), &extension_value, &counts, most)
        .map(Some)
        .map_err(|what| {
            check.problem(&extension.place, what, "export without this compression");
            Reported
        })
}

/// The attributes of one primitive, packed or plain.
struct Vertices<'a, 'b> {
    attributes: &'a Item<'a>,
    unpacked: Option<&'a DracoMesh>,
    accessors: &'a mut Accessors<'b>,
    check: &'a mut Check,
}

impl Vertices<'_, '_> {
    fn read<const N: usize>(
        &mut self,
        semantic: &str,
        count: Option<usize>,
    ) -> Option<Vec<[f32; N]>> {
        let place = format!("{}, {semantic}", self.attributes.place);
        if let Some(mesh) = self.unpacked {
            if let Some((_, plain)) = mesh.attributes.iter().find(|(name, _)| name == semantic) {
                if plain.width == N {
                    return Some(to_vectors(&plain.bytes, plain.component, plain.normalized));
                }
                let what = format!("has {} components an element, not {N}", plain.width);
                self.check.problem(&place, what, AGAIN);
                return None;
            }
        }
        let accessor = self.attributes.index(semantic, self.check)?;
        self.accessors.vectors(accessor, count, &place, self.check)
    }

    /// The inner none: the primitive does not have it; the outer one: it is broken, which was reported.
    fn optional<const N: usize>(
        &mut self,
        semantic: &str,
        count: usize,
    ) -> Option<Option<Vec<[f32; N]>>> {
        if !self.attributes.map.contains_key(semantic) {
            return Some(None);
        }
        let values = self.read::<N>(semantic, Some(count))?;
        if values.len() == count {
            return Some(Some(values));
        }
        // Only what Draco unpacked can come here.
        let place = format!("{}, {semantic}", self.attributes.place);
        let what = format!("has {} elements for {count} vertices", values.len());
        self.check.problem(&place, what, AGAIN);
        None
    }

    /// COLOR_0, of three or four components.
    fn colors(&mut self, count: usize) -> Option<Option<Vec<[f32; 4]>>> {
        const NAME: &str = "COLOR_0";
        if !self.attributes.map.contains_key(NAME) {
            return Some(None);
        }
        let unpacked = self
            .unpacked
            .and_then(|m| m.attributes.iter().find(|(n, _)| n == NAME));
        let width = match unpacked {
            Some((_, plain)) => plain.width,
            None => {
                let place = format!("{}, {NAME}", self.attributes.place);
                let accessor = self.attributes.index(NAME, self.check)?;
                self.accessors.layout(accessor, &place, self.check)?.1.width
            }
        };
        if width == 4 {
            return self.optional::<4>(NAME, count);
        }
        let rgb = self.optional::<3>(NAME, count)?;
        Some(rgb.map(|rgb| rgb.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()))
    }
}

/// The corners of a list, strip or fan, in the standard's order (section 3.7.2.1), all turned the same way.
fn triangles(indices: &[u32], mode: Mode) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => indices
            .chunks_exact(3)
            .map(|c| [c[0], c[1], c[2]])
            .collect(),
        Mode::Strip => {
            let turn = |(i, c): (usize, &[u32])| {
                if i % 2 == 0 {
                    [c[0], c[1], c[2]]
                } else {
                    [c[0], c[2], c[1]]
                }
            };
            indices.windows(3).enumerate().map(turn).collect()
        }
        Mode::Fan => match indices {
            [hub, rim @ ..] => rim.windows(2).map(|c| [c[0], c[1], *hub]).collect(),
            [] => Vec::new(),
        },
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
            triangles(&[5, 6, 7, 8, 9], Mode::Strip),
            [[5, 6, 7], [6, 8, 7], [7, 8, 9]]
        );
        assert_eq!(triangles(&[5, 6, 7, 8], Mode::Fan), [[6, 7, 5], [7, 8, 5]]);
        assert_eq!(triangles(&[0, 1, 2, 3, 4], Mode::Triangles), [[0, 1, 2]]);
        for mode in [Mode::Triangles, Mode::Strip, Mode::Fan] {
            for length in 0..3 {
                assert!(triangles(&[0, 1, 2][..length], mode).is_empty());
            }
        }
    }
}
