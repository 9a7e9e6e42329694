//! OpenEXR: the colour and every extra value as layers of one file.
//!
//! Layers are named as OpenEXR's guide says: the colour's channels are `R`, `G`, `B` and `A`, those of others have
//! their layer's name before a dot, such as `normal.X`. All are 32-bit floats; ids are 32-bit unsigned.

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    SmallVec, WritableImage as _,
};

use crate::formats::atomic_file::Sink;
use crate::render::{AovKind, Film};

/// Writes a film with its values as they are, but for the colour, which is multiplied by `exposure`.
pub fn write(film: &Film, exposure: f32, out: &mut dyn Sink) -> exr::error::UnitResult {
    let mut channels = SmallVec::<[AnyChannel<FlatSamples>; 4]>::new();
    for (index, name) in ["R", "G", "B"].into_iter().enumerate() {
        let values = film.color.iter().map(|color| color[index] * exposure).collect();
        channels.push(AnyChannel::new(name, FlatSamples::F32(values)));
    }
    if let Some(alpha) = &film.alpha {
        channels.push(AnyChannel::new("A", FlatSamples::F32(alpha.clone())));
    }
    for aov in &film.aovs {
        for (name, values) in aov.kind.channels().iter().zip(&aov.channels) {
            let samples = match aov.kind {
                AovKind::Id => FlatSamples::U32(values.iter().map(|value| value.to_bits()).collect()),
                _ => FlatSamples::F32(values.clone()),
            };
            channels.push(AnyChannel::new(format!("{}.{name}", aov.kind.name()).as_str(), samples));
        }
    }
    // Deflate is what every reader knows; lines in order give the same bytes whatever the threads.
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = (film.width as usize, film.height as usize);
    let layer = Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(channels));
    Image::from_layer(layer).write().to_buffered(out)
}
