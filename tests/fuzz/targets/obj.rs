//! An OBJ file; the libraries and images that it names are not there.
#![no_main]

use libfuzzer_sys::fuzz_target;
use whitted::formats::obj;
use whitted::progress::Silent;
use whitted_fuzz::{check, folder, options};

fuzz_target!(|bytes: &[u8]| {
    let options = options(bytes.last().copied().unwrap_or(0));
    if let Ok(model) = obj::read(bytes, &folder().join("model.obj"), &options, &Silent) {
        check(&model);
    }
});
