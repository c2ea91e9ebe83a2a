//! EXT_mesh_gpu_instancing: many copies of a node's mesh, each with its own translation, rotation and scale.

use crate::scene::accessor::Accessors;
use crate::scene::check::Check;
use crate::scene::json::Item;
use crate::scene::nodes;
use glam::{DMat4, DVec3, Vec3};
use gltf::json::{Accessor, Index};
use serde::Deserialize;
use std::collections::BTreeMap;

const NAME: &str = "EXT_mesh_gpu_instancing";
const AGAIN: &str = "export the file again";

const ATTRIBUTES: [&str; 3] = ["TRANSLATION", "ROTATION", "SCALE"];

/// The extension on a node.
#[derive(Debug, Deserialize)]
struct Instancing {
    #[serde(default)]
    attributes: BTreeMap<String, Index<Accessor>>,
}

/// How many instances a node has by EXT_mesh_gpu_instancing.
pub(crate) fn count(
    node: &Item<'_>,
    accessors: &Accessors<'_>,
    check: &mut Check,
) -> Option<usize> {
    let attributes = node.extension::<Instancing>(NAME, check)?.attributes;
    let each = ATTRIBUTES.iter().filter_map(|semantic| {
        let accessor = attributes.get(*semantic)?.value();
        let (_, layout) = accessors.layout(accessor, "", check)?;
        Some(layout.count)
    });
    each.max()
}

/// The transforms of a node's instances; the inner none: it has none, the outer: they are broken, which was reported.
pub(crate) fn read(
    node: &Item<'_>,
    accessors: &mut Accessors<'_>,
    check: &mut Check,
) -> Option<Option<Vec<DMat4>>> {
    let Some(Instancing { attributes }) = node.extension(NAME, check) else {
        return Some(None);
    };
    let place = &format!("{}, {NAME}", node.place);
    let [translation, rotation, scale] = ATTRIBUTES.map(|name| {
        let accessor = attributes.get(name);
        accessor.map(|accessor| (accessor.value(), format!("{place}, {name}")))
    });
    let translations = values::<3>(accessors, translation, check)?;
    let rotations = values::<4>(accessors, rotation, check)?;
    let scales = values::<3>(accessors, scale, check)?;
    let counts = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let mut counts = counts.into_iter().flatten();
    let Some(count) = counts.next() else {
        return Some(None);
    };
    if counts.any(|other| other != count) {
        check.problem(place, "has attributes of different lengths", AGAIN);
        return None;
    }
    let pick = |values: &Option<Vec<[f32; 3]>>, i: usize, otherwise: DVec3| {
        values
            .as_ref()
            .map_or(otherwise, |v| Vec3::from(v[i]).as_dvec3())
    };
    let matrix = |i: usize| {
        let turn = rotations
            .as_ref()
            .map_or([0.0, 0.0, 0.0, 1.0], |r| r[i].map(f64::from));
        DMat4::from_scale_rotation_translation(
            pick(&scales, i, DVec3::ONE),
            nodes::rotation(turn),
            pick(&translations, i, DVec3::ZERO),
        )
    };
    let matrices: Vec<DMat4> = (0..count).map(matrix).collect();
    if let Some(bad) = matrices.iter().position(|m| !m.is_finite()) {
        let what = format!("has a transform that is not finite, at instance {bad}");
        check.problem(place, what, AGAIN);
        return None;
    }
    Some(Some(matrices))
}

fn values<const N: usize>(
    accessors: &mut Accessors<'_>,
    attribute: Option<(usize, String)>,
    check: &mut Check,
) -> Option<Option<Vec<[f32; N]>>> {
    let Some((accessor, place)) = attribute else {
        return Some(None);
    };
    let vectors = accessors.vectors::<N>(accessor, None, &place, check);
    vectors.map(Some)
}
