//! A material library, under a model that uses materials of it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use whitted::formats::obj;
use whitted::progress::Silent;
use whitted_fuzz::{check, folder, options};

/// Materials by the names that the seeds have.
const MODEL: &[u8] = b"mtllib model.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n\
    usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\nusemtl c\nf 1/1 2/2 3/3\n";

fuzz_target!(|bytes: &[u8]| {
    std::fs::write(folder().join("model.mtl"), bytes).expect("the temporary folder can be written");
    let model = obj::read(MODEL, &folder().join("model.obj"), &options(0), &Silent);
    check(&model.expect("trouble with materials is a warning"));
});
