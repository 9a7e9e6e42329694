//! Answers that can be trusted: exact hits, numerically hard cases, speed against error, differences of pictures.
//!
//! Nothing here is on the renderer's path. What is measured is the renderer as users call it; what it is compared with
//! does not share its formulas.
//!
//! | module | holds |
//! |---|---|
//! | [`dyadic`] | exact numbers |
//! | [`hexadecimal`] | numbers written exactly |
//! | [`machine`], [`environment`] | what answers were computed on, and measured on |
//! | [`agreement`] | whether the renderer agrees with exact answers, by classes with proven bounds |
//! | [`cases`] | the hard cases and what they count |
//! | [`features`] | what each feature of a scene costs it, present and absent |
//! | [`picture_difference`], [`heatmap`] | how far two pictures are apart, and where |
//! | [`oracle`] | exact hits |
//! | [`scenes`] | small scenes with known answers |
//! | [`light_paths`] | shadows and mirrors: acne, leaks, contact gaps, positions after bounces |
//! | [`generated`] | large models that need no file |
//! | [`rays`], [`ray_set`] | families of rays for any scene; sets of rays and their answers |
//! | [`ray_file`], [`hit_file`] | rays from files, answers to files |
//! | [`variants`] | other ways to do what the renderer does, from their publications |
//! | [`speed`], [`sweep`] | interleaved timing; rates with intervals, and what is dominated |
//! | [`table`], [`plot`] | Markdown tables; scatter plots as SVG |
//! | [`report`] | speed against error, as `whitted report` writes it |
//! | [`bench`](mod@bench), [`peers`] | which structure suits a mesh, as `whitted bench` measures it; other programs' structures |
//! | [`reference`](mod@reference) | the picture of f64 rays and exact hits |
//! | [`statistics`] | rates with their bounds, quantiles, medians with intervals |

pub mod agreement;
pub mod bench;
pub mod cases;
pub mod dyadic;
pub mod environment;
pub mod features;
pub mod generated;
pub mod heatmap;
pub mod hexadecimal;
pub mod hit_file;
pub mod light_paths;
pub mod machine;
pub mod oracle;
pub mod peers;
pub mod picture_difference;
pub mod plot;
pub mod ray_file;
pub mod ray_set;
pub mod rays;
pub mod reference;
pub mod report;
pub mod scenes;
pub mod speed;
pub mod statistics;
pub mod sweep;
pub mod table;
pub mod variants;
