//! A glTF document, opened: container, JSON and buffers read and checked, materials and lights typed.
//!
//! `open` fails only where nothing can be read on: no file, no JSON, another version, a required extension that is not
//! known. Everything else that is wrong is collected and comes out of [`Document::load_geometry`] together.

use crate::error::{Error, Result};
use crate::scene::Source;
use crate::scene::buffers::{Buffers, size};
use crate::scene::check::Check;
use crate::scene::compression;
use crate::scene::container;
use crate::scene::json::{self, Item};
use crate::scene::nodes::{self, PlacedNode};
use crate::scene::raw;
pub use crate::scene::raw::{AlphaMode, RawLight, RawLightKind, RawMaterial};
use crate::scene::texture_info::Slots;
use crate::scene::uri;
use gltf::json::{Asset, Buffer};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const AGAIN: &str = "export the file again";

/// Extensions that are read. The packed ones count only where their decoder is built in.
const READ: [&str; 12] = [
    "EXT_lights_ies",
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Extensions that are not read, but leave a file without them whole: they add gloss, variants or metadata to surfaces
/// that stay Lambertian here. A file that requires one is read with a warning.
const HARMLESS: [&str; 10] = [
    "KHR_animation_pointer",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_variants",
    "KHR_node_visibility",
    "KHR_xmp_json_ld",
];

/// A document: everything read, nothing yet turned into geometry.
///
/// ```
/// use haarlight::scene::document::Document;
/// use std::path::Path;
///
/// // One triangle of three float positions; the buffer is in the file.
/// let room = br#"{"asset": {"version": "2.0"}, "nodes": [{"name": "floor", "mesh": 0}],
///     "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
///     "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
///     "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36,
///     "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAAAAAAIA/"}]}"#;
/// let document = Document::from_bytes(Path::new("room.gltf"), room)?;
/// let geometry = document.load_geometry().check()?;
/// assert_eq!(geometry.surfaces[0].name, "node 0 'floor', mesh 0, primitive 0");
/// assert_eq!(geometry.surfaces[0].positions[1].x, 1.0);
/// # Ok::<(), haarlight::Error>(())
/// ```
#[derive(Debug)]
pub struct Document {
    /// The JSON and the buffers.
    pub source: Source,
    /// Extensions that the document uses and this program does not read, sorted.
    pub unsupported: Vec<String>,
    pub(crate) buffers: Buffers,
    pub(crate) placed: Vec<PlacedNode>,
    pub(crate) slots: Slots,
    pub(crate) materials: Vec<RawMaterial>,
    pub(crate) check: Check,
    lights: Vec<RawLight>,
}

impl Document {
    /// Opens a `.glb` or `.gltf` file (told apart by content) and the buffers beside it.
    ///
    /// # Errors
    /// [`Error::Io`] if there is no such file; [`Error::Input`] if it is not glTF 2.0 or requires an unknown extension.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
        let file = path.display().to_string();
        let bytes = uri::read_file(path)
            .map_err(|why| Error::input(&file, why, "give a .glb or .gltf file"))?;
        Self::from_bytes(path, &bytes)
    }

    /// A document from the bytes of its file; `path` is for messages, and what the document refers to is looked for
    /// beside it.
    ///
    /// # Errors
    /// As [`Document::open`].
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        let file = path.display().to_string();
        let container = container::parse(&file, bytes)?;
        let json = container.json;
        let mut check = Check::new(&file);
        for warning in container.warnings {
            check.warn(format!("{file}: {warning}"));
        }
        version(&json, &mut check);
        baked(&json, &mut check);
        let unsupported = extensions(&json, &mut check);
        if check.has_problems() {
            return Err(Error::Input(check.into_parts().0));
        }
        let buffers = buffers(&json, &uri::folder_of(path), container.bin, &mut check);
        let placed = nodes::walk(&json, &mut check);
        let mut slots = Slots::default();
        let materials = raw::materials(&json, &mut slots, &mut check);
        let lights = raw::lights(&json, &placed, &mut check);
        Ok(Self {
            source: Source {
                path: path.to_owned(),
                json,
                buffers: buffers.bytes.clone(),
            },
            unsupported,
            buffers,
            placed,
            slots,
            materials,
            check,
            lights,
        })
    }

    /// Materials in the document's order; after them glTF's default material if some primitive names none.
    /// `Surface::material` is an index in this list.
    pub fn raw_materials(&self) -> &[RawMaterial] {
        &self.materials
    }

    /// The punctual lights of the scene, one entry for each node that carries one, in order of the node walk.
    pub fn raw_lights(&self) -> &[RawLight] {
        &self.lights
    }
}

fn version(json: &Value, check: &mut Check) {
    let next = "export as glTF 2.0";
    let map = json.get("asset").and_then(Value::as_object);
    let item = map.map(|map| Item {
        map,
        place: String::new(),
    });
    let Some(asset) = item.and_then(|item| item.read::<Asset>(&mut Check::new(""))) else {
        let what = "has no 'asset' with a version, so it is not glTF";
        return check.problem("", what, next);
    };
    let version = &asset.version;
    if version != "2" && !version.starts_with("2.") {
        let what = format!("is glTF {}, only 2.0 is read", json::short(version));
        check.problem("", what, next);
    }
    let least = asset.min_version.as_deref();
    if let Some(least) = least.filter(|&v| v != "2.0" && v != "2") {
        let least = json::short(least);
        let what = format!("needs a reader of glTF {least}, this one reads 2.0");
        check.problem("", what, next);
    }
}

/// Says so if the room is our own output: its vertex colours are light, and taken as paint all the same.
fn baked(json: &Value, check: &mut Check) {
    let exposure = json.pointer("/asset/extras/haarlight/exposure");
    if exposure.is_some_and(Value::is_object) {
        check.warn(
            "this room holds baked light already: its vertex colours, which are light, count as paint; \
             bake the room that it was made from",
        );
    }
}

/// Checks what the document requires; returns what it uses and is not read.
fn extensions(json: &Value, check: &mut Check) -> Vec<String> {
    let root = json::root(json, check);
    let sorted = |names: &mut Vec<String>| {
        names.sort_unstable();
        names.dedup();
    };
    let read = |name: &String| READ.contains(&name.as_str()) || compression::is_built_in(name);
    let mut missing = root.extensions_required.clone();
    sorted(&mut missing);
    missing.retain(|name| !read(name) && !HARMLESS.contains(&name.as_str()));
    if !missing.is_empty() {
        let what = format!("requires what is not supported: {}", missing.join(", "));
        let next = "export without these extensions";
        check.problem("extensionsRequired", what, next);
    }
    let mut unsupported = root.extensions_used;
    unsupported.extend(root.extensions_required);
    sorted(&mut unsupported);
    unsupported.retain(|name| !read(name));
    if !unsupported.is_empty() {
        let list = unsupported.join(", ");
        check.warn(format!("extensions that are not read: {list}"));
    }
    unsupported
}

/// Reads all buffers; a missing one is a problem.
fn buffers(json: &Value, folder: &Path, bin: Option<&[u8]>, check: &mut Check) -> Buffers {
    let used = json::root(json, check).extensions_used;
    let placeholders = (used.iter()).any(|name| compression::MESHOPT.contains(&name.as_str()));
    let mut buffers = Buffers {
        bytes: Vec::new(),
        sound: Vec::new(),
    };
    // Buffers of one file share its bytes: else a small document could ask for a large file many times.
    let mut files: BTreeMap<PathBuf, Arc<[u8]>> = BTreeMap::new();
    for index in 0..json::len(json, "buffers") {
        let read = buffer(json, index, folder, bin, placeholders, &mut files, check);
        buffers.sound.push(read.is_some());
        buffers.bytes.push(read.unwrap_or_else(|| Arc::from([])));
    }
    buffers
}

fn buffer(
    json: &Value,
    index: usize,
    folder: &Path,
    bin: Option<&[u8]>,
    placeholders: bool,
    files: &mut BTreeMap<PathBuf, Arc<[u8]>>,
    check: &mut Check,
) -> Option<Arc<[u8]>> {
    let Some(item) = json::item(json, "buffers", "buffer", index) else {
        check.problem(&format!("buffer {index}"), "is not an object", AGAIN);
        return None;
    };
    if !item.has("byteLength") {
        check.problem(&item.place, "has no byteLength", AGAIN);
        return None;
    }
    let given = item.read::<Buffer>(check)?;
    let length = size(given.byte_length);
    let bytes = if let Some(uri) = given.uri {
        let read = shared(folder, &uri, files);
        let failed = |why| check.problem(&item.place, why, "put the buffer there");
        read.map_err(failed).ok()?
    } else if item.has("uri") {
        return None;
    } else if let (0, Some(bin)) = (index, bin) {
        Arc::from(bin)
    } else if placeholders {
        // EXT_meshopt_compression: stands for bytes that only packed views have. Whoever reads it plainly finds it empty.
        return Some(Arc::from([]));
    } else {
        let what = "has no URI, and the file has no binary chunk for it";
        check.problem(&item.place, what, AGAIN);
        return None;
    };
    if bytes.len() < length {
        let what = format!("claims {length} bytes, but has {}", bytes.len());
        check.problem(&item.place, what, AGAIN);
        return None;
    }
    Some(bytes)
}

/// The bytes behind a URI; those of one file are read once.
fn shared(
    folder: &Path,
    given: &str,
    files: &mut BTreeMap<PathBuf, Arc<[u8]>>,
) -> std::result::Result<Arc<[u8]>, String> {
    let path = match uri::locate(folder, given)? {
        uri::UriTarget::Here(bytes) => return Ok(bytes.into()),
        uri::UriTarget::File(path) => path,
    };
    if let Some(known) = files.get(&path) {
        return Ok(Arc::clone(known));
    }
    let bytes = uri::read_file(&path).map_err(|e| format!("'{}' {e}", json::short(given)))?;
    let bytes: Arc<[u8]> = bytes.into();
    files.insert(path, Arc::clone(&bytes));
    Ok(bytes)
}
