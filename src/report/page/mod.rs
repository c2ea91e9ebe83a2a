//! A bake as one HTML page that needs nothing else: the room to walk around in, its figures, plots and warnings.
//!
//! The page holds the viewer (built in `tools/web`, with its licences), the baked room as it is on disk, and the light at its
//! vertices, each deflated and in base64; the browser's DecompressionStream opens them. Its content security policy
//! forbids every request. The records of the log are in it as they are, so that its numbers are theirs.

mod history;
mod light;
mod room;

pub use history::History;
#[cfg(feature = "cli")]
pub(crate) use light::error_map;
pub use room::lamp_spectra;
pub use room::of as room;

use crate::error::{Error, Result};
use crate::gather::Baked;
use crate::output::gltf;
use crate::scene::Camera;
use crate::solve::Bake;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::{Value, json};
use std::io::Write;

/// Around the data.
const FRAME: &str = include_str!("page.html");
/// The picture with what lies in it, and its keys: as live pages have them.
pub(crate) const PICTURE: &str = include_str!("picture.html");
pub(crate) const KEYS: &str = include_str!("keys.html");
pub(crate) const STYLE: &str = include_str!("page.css");
/// `tools/web`, bundled, gzip.
pub(crate) const VIEWER: &[u8] = include_bytes!("viewer.js.gz");
/// Licences of what the viewer is made of.
pub(crate) const NOTICES: &str = include_str!("NOTICES.txt");

/// What a page is made of.
pub struct Page<'a> {
    /// The bake, at its end.
    pub bake: &'a Bake,
    /// Its mesh.
    pub baked: &'a Baked,
    /// What it is looked at through, as in its pictures.
    pub cameras: &'a [Camera],
    /// The file that was written of it.
    pub glb: &'a [u8],
    /// The light of the rounds.
    pub history: &'a History,
    /// Records of the log: `plan`, `rounds`, `audit` (or null), `verdict`.
    pub log: Value,
}

impl Page<'_> {
    /// The page. Equal input gives equal bytes.
    ///
    /// # Errors
    /// An internal fault: memory that cannot be written to.
    pub fn html(&self) -> Result<String> {
        let scene = self.bake.scene();
        let order = gltf::order(scene, &self.baked.surfaces);
        let (index, planes) = light::pack(self.bake, self.baked, self.history, &order);
        let path = &scene.source.path;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = name.trim_end_matches(".glb").trim_end_matches(".gltf");
        let data = json!({
            "name": name,
            "log": self.log,
            "room": room::of(self.bake, self.cameras),
            "light": index,
        });
        let parts = [
            ("{{title}}", escaped(name)),
            ("{{style}}", STYLE.to_owned()),
            ("{{picture}}", PICTURE.to_owned()),
            ("{{keys}}", KEYS.to_owned()),
            ("{{notices}}", escaped(NOTICES)),
            ("{{data}}", script(&data)),
            ("{{glb}}", base64(&deflated(self.glb)?)),
            ("{{planes}}", base64(&deflated(&planes)?)),
            ("{{viewer}}", base64(VIEWER)),
        ];
        let mut out = String::new();
        let mut rest = FRAME;
        // In the order of the frame, so that nothing inside a part is taken for a place.
        for (place, part) in &parts {
            let (before, after) = rest
                .split_once(place)
                .ok_or_else(|| Error::Internal(format!("page: no {place}")))?;
            out += before;
            out += part;
            rest = after;
        }
        Ok(out + rest)
    }
}

fn deflated(bytes: &[u8]) -> Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    let done = encoder.write_all(bytes).and_then(|()| encoder.finish());
    done.map_err(|problem| Error::Internal(format!("page: {problem}")))
}

/// JSON that cannot end the script element it stands in.
fn script(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// Text as HTML.
pub(crate) fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |k: usize| u32::from(three.get(k).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for k in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * k) & 63) as usize];
            out.push(if k <= three.len() { letter.into() } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_as_in_the_rfc() {
        for (text, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(text.as_bytes()), coded);
        }
    }

    #[test]
    fn names_cannot_leave_their_place() {
        let data = script(&json!({ "name": "</script><b>" }));
        assert!(!data.contains('<'), "{data}");
        assert_eq!(escaped("<a b=\"c\">&"), "&lt;a b=&quot;c&quot;&gt;&amp;");
    }
}
