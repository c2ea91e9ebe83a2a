//! The document behind a scene, and the bytes of what it names.

use super::buffers::{Buffers, Views};
use super::check::Check;
use super::json::{self, Item};
use super::uri;
use crate::error::{Error, Result};
use gltf::json::Image;
use std::path::PathBuf;
use std::sync::Arc;

const AGAIN: &str = "export the file again";

/// The glTF document behind a scene: kept whole, so that names, cameras, extras and unknown things survive.
#[derive(Debug, Clone)]
pub struct Source {
    /// The file that was read.
    pub path: PathBuf,
    /// The whole JSON, as in the file.
    pub json: serde_json::Value,
    /// The buffers of the document, decoded, in order of the JSON's `buffers`.
    pub buffers: Vec<Arc<[u8]>>,
}

impl Source {
    /// Where the problems of a whole room are.
    pub(crate) fn place(&self) -> String {
        self.path.display().to_string()
    }

    /// The bytes of an image of the document, as stored (PNG or JPEG as a rule), wherever they are: in a buffer, a data
    /// URI or a file beside the document.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such image or its bytes cannot be had.
    pub fn image_bytes(&self, index: usize) -> Result<Vec<u8>> {
        let mut check = Check::new(self.path.display().to_string());
        let bytes = self.image_bytes_checked(index, &mut check);
        bytes.ok_or_else(|| Error::Input(check.into_parts().0))
    }

    fn image_bytes_checked(&self, index: usize, check: &mut Check) -> Option<Vec<u8>> {
        let item = json::referred(&self.json, "images", "image", index, "", check)?;
        self.bytes_of(&item, check)
    }

    /// What an image, or anything that names its bytes as images do, stands for.
    pub(crate) fn bytes_of(&self, item: &Item<'_>, check: &mut Check) -> Option<Vec<u8>> {
        match item.read::<Image>(check)? {
            Image { uri: Some(uri), .. } => uri::read(&uri::folder_of(&self.path), &uri)
                .map_err(|why| check.problem(&item.place, why, "put the file there"))
                .ok(),
            Image {
                buffer_view: Some(view),
                ..
            } => {
                let buffers = Buffers::sound(self.buffers.clone());
                let mut views = Views::new(&self.json, &buffers);
                let span = views.view(view.value(), &item.place, check)?;
                Some(span.bytes().to_vec())
            }
            _ => {
                check.problem(&item.place, "has neither a URI nor a bufferView", AGAIN);
                None
            }
        }
    }
}
