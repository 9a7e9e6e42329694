//! A binary glTF file: what is in its chunks, with headers made right half of the time, since chance seldom does.
#![no_main]

use libfuzzer_sys::fuzz_target;
use whitted::formats::gltf;
use whitted::progress::Silent;
use whitted_fuzz::{check, folder, options};

fuzz_target!(|bytes: &[u8]| {
    let Some((&choice, bytes)) = bytes.split_last() else { return };
    let file = if choice & 64 == 0 { bytes.to_vec() } else { packed(bytes) };
    if let Ok(model) = gltf::read(&file, &folder(), &options(choice), &Silent) {
        check(&model);
    }
});

/// The JSON to the last closing brace as one chunk, what follows as the binary one.
fn packed(bytes: &[u8]) -> Vec<u8> {
    let end = bytes.iter().rposition(|&byte| byte == b'}').map_or(bytes.len(), |at| at + 1);
    let (json, binary) = bytes.split_at(end);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((12 + 16 + bytes.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}
