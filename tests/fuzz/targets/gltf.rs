//! The JSON of a glTF file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use whitted::formats::gltf;
use whitted::progress::Silent;
use whitted_fuzz::{check, folder, options};

fuzz_target!(|bytes: &[u8]| {
    let options = options(bytes.last().copied().unwrap_or(0));
    if let Ok(model) = gltf::read(bytes, &folder(), &options, &Silent) {
        check(&model);
    }
});
