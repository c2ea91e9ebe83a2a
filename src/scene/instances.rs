//! EXT_mesh_gpu_instancing: many copies of a node's mesh, each with its own translation, rotation and scale.

use crate::scene::accessor::Accessors;
use crate::scene::check::Check;
use crate::scene::json::Item;
use crate::scene::nodes;
use glam::{DMat4, DVec3, Vec3};

const NAME: &str = "EXT_mesh_gpu_instancing";
const AGAIN: &str = "export the file again";

const ATTRIBUTES: [&str; 3] = ["TRANSLATION", "ROTATION", "SCALE"];

fn attributes<'a>(node: &Item<'a>, check: &mut Check) -> Option<Item<'a>> {
    if !node.map.contains_key("extensions") {
        return None;
    }
    let mut attributes = node.extension(NAME, check)?.child("attributes", check)?;
    attributes.place = format!("{}, {NAME}", node.place);
    Some(attributes)
}

/// How many instances a node has by EXT_mesh_gpu_instancing.
pub(crate) fn count(
    node: &Item<'_>,
    accessors: &Accessors<'_>,
    check: &mut Check,
) -> Option<usize> {
    let attributes = attributes(node, check)?;
    let each = ATTRIBUTES.iter().filter_map(|semantic| {
        let accessor = attributes.index(semantic, check)?;
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
    let Some(attributes) = attributes(node, check) else {
        return Some(None);
    };
    let [translation, rotation, scale] = ATTRIBUTES;
    let translations = values::<3>(&attributes, accessors, translation, check)?;
    let rotations = values::<4>(&attributes, accessors, rotation, check)?;
    let scales = values::<3>(&attributes, accessors, scale, check)?;
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
        check.problem(
            &attributes.place,
            "has attributes of different lengths",
            AGAIN,
        );
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
        check.problem(&attributes.place, what, AGAIN);
        return None;
    }
    Some(Some(matrices))
}

fn values<const N: usize>(
    attributes: &Item<'_>,
    accessors: &mut Accessors<'_>,
    semantic: &str,
    check: &mut Check,
) -> Option<Option<Vec<[f32; N]>>> {
    if !attributes.map.contains_key(semantic) {
        return Some(None);
    }
    let place = format!("{}, {semantic}", attributes.place);
    let accessor = attributes.index(semantic, check)?;
    accessors
        .vectors::<N>(accessor, None, &place, check)
        .map(Some)
}
