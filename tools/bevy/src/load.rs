//! Bevy's asset server without a window: files, loaded to the end.

use bevy_app::{App, TaskPoolPlugin};
use bevy_asset::{Asset, AssetApp, AssetPlugin, AssetServer, Handle, LoadState};
use bevy_gltf::GltfPlugin;
use bevy_image::{CompressedImageFormats, Image, ImageLoader, ImagePlugin};
use bevy_mesh::MeshPlugin;
use bevy_world_serialization::WorldSerializationPlugin;
use std::path::Path;
use std::time::{Duration, Instant};

/// A file has this long.
const PATIENCE: Duration = Duration::from_secs(120);

/// The asset server of a folder.
pub(crate) struct Assets(App);

impl Assets {
    pub(crate) fn of(folder: &Path) -> Self {
        let folder = std::path::absolute(folder).expect("a path");
        let mut app = App::new();
        app.add_plugins((
            TaskPoolPlugin::default(),
            AssetPlugin {
                file_path: folder.to_string_lossy().into_owned(),
                ..AssetPlugin::default()
            },
            WorldSerializationPlugin,
            ImagePlugin::default(),
            MeshPlugin,
            GltfPlugin::default(),
        ));
        // What the renderer does once it knows the graphics card.
        app.register_asset_loader(ImageLoader::new(CompressedImageFormats::NONE));
        app.finish();
        app.cleanup();
        Self(app)
    }

    /// Loads a file and what it names; the handle keeps it.
    pub(crate) fn load<A: Asset>(&mut self, name: &str) -> Handle<A> {
        let server = self.0.world().resource::<AssetServer>().clone();
        let handle = server.load(name.to_owned());
        let start = Instant::now();
        loop {
            self.0.update();
            match server.load_state(&handle) {
                LoadState::Loaded => break,
                LoadState::Failed(problem) => panic!("{name}: {problem}"),
                _ if start.elapsed() > PATIENCE => panic!("{name} is not loaded"),
                _ => std::thread::sleep(Duration::from_millis(1)),
            }
        }
        self.0.update();
        handle
    }

    pub(crate) fn get<A: Asset>(&self, handle: &Handle<A>) -> &A {
        let all = self.0.world().resource::<bevy_asset::Assets<A>>();
        all.get(handle).expect("a loaded asset")
    }

    /// A texture's numbers: its sides, and red, green, blue of each texel.
    pub(crate) fn texture(&mut self, name: &str) -> Texture {
        let handle = self.load::<Image>(name);
        let image = self.get(&handle);
        let size = image.texture_descriptor.size;
        let sides = [size.width, size.height, size.depth_or_array_layers].map(|n| n as usize);
        let bytes = image.data.as_deref().expect("texels");
        let texels = bytes.len() / sides.iter().product::<usize>();
        let number = |b: &[u8]| match texels {
            8 => f64::from(half::f16::from_le_bytes([b[0], b[1]])),
            _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        };
        let width = texels / 4;
        let texel = |t: &[u8]| [0, 1, 2].map(|c| number(&t[c * width..]));
        Texture {
            sides,
            texels: bytes.chunks(texels).map(texel).collect(),
        }
    }
}

/// A texture of one, two or three dimensions.
pub(crate) struct Texture {
    pub(crate) sides: [usize; 3],
    pub(crate) texels: Vec<[f64; 3]>,
}

impl Texture {
    /// What a linear sampler finds at coordinates from 0 to 1.
    pub(crate) fn sample(&self, at: [f64; 3]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for corner in 0..8 {
            let (mut weight, mut index) = (1.0, 0);
            for axis in (0..3).rev() {
                let x = at[axis] * self.sides[axis] as f64 - 0.5;
                let upper = corner >> axis & 1;
                let t = x - x.floor();
                weight *= if upper == 1 { t } else { 1.0 - t };
                let texel = (x.floor() + upper as f64).clamp(0.0, self.sides[axis] as f64 - 1.0);
                index = index * self.sides[axis] + texel as usize;
            }
            let texel = self.texels[index];
            (0..3).for_each(|c| sum[c] += weight * texel[c]);
        }
        sum
    }
}
