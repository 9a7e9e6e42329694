//! Rules that the source keeps: imports go one way, and arithmetic is the same on every machine. Read from its text.

use std::path::{Path, PathBuf};

/// Modules in layers; a module may use those of lower layers and itself, not its neighbours.
const LAYERS: &[&[&str]] = &[
    &["array", "error", "progress", "math"],
    &["geometry"],
    &["scene", "accel"],
    &["render"],
    &["formats"],
    &["job"],
    &["measure"],
    &["editor"],
    &["cli", "manual"],
];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The first path segments after `crate::` in a source text, comments left out; `use crate::{a::b, c}` gives a and c.
fn used_modules(source: &str) -> Vec<String> {
    let code: String =
        source.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let mut modules = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let word = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut start = true;
            for (i, c) in group.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => start = true,
                    c if start && !c.is_whitespace() => {
                        modules.push(word(&group[i..]));
                        start = false;
                    }
                    _ => {}
                }
            }
        } else {
            modules.push(word(rest));
        }
    }
    modules
}

#[test]
fn the_reader_of_imports_understands_groups() {
    let source = "use crate::{error::Error, math::{a, b}, scene};\n// crate::comment\nlet x = crate::render::f();";
    assert_eq!(used_modules(source), ["error", "math", "scene", "render"]);
}

#[test]
fn imports_go_one_way() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    assert!(files.len() > 30, "only {} files found", files.len());
    let mut wrong = Vec::new();
    for file in files {
        let inner = file.strip_prefix(&src).unwrap();
        let module = inner.components().next().unwrap().as_os_str().to_string_lossy().replace(".rs", "");
        if ["lib", "main"].contains(&module.as_str()) {
            continue;
        }
        let own = layer(&module).unwrap_or_else(|| panic!("`{module}` has no place in the layers"));
        for used in used_modules(&std::fs::read_to_string(&file).unwrap()) {
            if let Some(other) = layer(&used)
                && used != module
                && (other > own || (other == own && own > 0))
            {
                wrong.push(format!("{} uses crate::{used}", inner.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "backward imports:\n{}", wrong.join("\n"));
}

/// Functions whose last bits depend on the platform or the build: sums in an order of glam's choice, and std's
/// transcendental functions. Square roots are exact everywhere.
const PLATFORM_ARITHMETIC: &[&str] = &[
    // glam; `math::vector` and `math::transform` have what is needed of these.
    "dot",
    "length",
    "length_squared",
    "length_recip",
    "normalize",
    "normalize_or",
    "normalize_or_zero",
    "try_normalize",
    "distance",
    "distance_squared",
    "angle_between",
    "project_onto",
    "reject_from",
    "reflect",
    "refract",
    "element_sum",
    "determinant",
    "inverse",
    "transform_point3",
    "transform_vector3",
    "mul_vec3",
    "mul_mat3",
    "from_quat",
    "from_axis_angle",
    "from_euler",
    "from_rotation_x",
    "from_rotation_y",
    "from_rotation_z",
    "from_scale_rotation_translation",
    "look_at_rh",
    // std; the crate `libm` has these.
    "mul_add",
    "powf",
    "powi",
    "sin",
    "cos",
    "tan",
    "sin_cos",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sinh",
    "cosh",
    "tanh",
    "exp",
    "exp2",
    "exp_m1",
    "ln",
    "ln_1p",
    "log",
    "log2",
    "log10",
    "cbrt",
    "hypot",
];

/// Calls of such functions in a source text, as methods or by the name of a type (of f32, f64 or glam); comments and the
/// module of tests at the end are left out.
fn platform_arithmetic(source: &str) -> Vec<String> {
    let code = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let mut found = Vec::new();
    for (number, line) in code.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
        for (at, _) in line.match_indices('(') {
            let start = line[..at].rfind(|c: char| !(c.is_alphanumeric() || c == '_')).map_or(0, |before| before + 1);
            let (before, name) = (&line[..start], &line[start..at]);
            let of_type = before.strip_suffix("::").is_some_and(|path| {
                let owner = path.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default();
                ["f32", "f64"].contains(&owner)
                    || owner.contains("Vec")
                    || owner.contains("Mat")
                    || owner.contains("Quat")
                    || owner.contains("Affine")
            });
            if PLATFORM_ARITHMETIC.contains(&name) && (before.ends_with('.') || of_type) {
                found.push(format!("{}: {name}", number + 1));
            }
        }
    }
    found
}

#[test]
fn platform_arithmetic_is_found_where_it_stands() {
    let source = "a.dot(b); dot(a, b);\n// a.length()\nlet x = libm::sin(y) + f64::sin(y).sqrt();\nDMat3::from_quat(q)\n\
                  v\n    .normalize()\n#[cfg(test)]\nmod tests {\n    a.dot(b)\n}";
    assert_eq!(platform_arithmetic(source), ["1: dot", "3: sin", "4: from_quat", "6: normalize"]);
}

#[test]
fn arithmetic_is_the_same_on_every_machine() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let is_test =
        |inner: &Path| inner.components().any(|part| ["tests", "tests.rs"].iter().any(|t| part.as_os_str() == *t));
    let mut wrong = Vec::new();
    for file in files {
        let inner = file.strip_prefix(&src).unwrap();
        if !is_test(inner) {
            let found = platform_arithmetic(&std::fs::read_to_string(&file).unwrap());
            wrong.extend(found.into_iter().map(|call| format!("{}:{call}", inner.display())));
        }
    }
    assert!(wrong.is_empty(), "use `math` or `libm` instead:\n{}", wrong.join("\n"));
}

#[test]
fn unsafe_code_is_where_it_is_allowed() {
    // Vectors in searches, values in mapped files, calls of OpenGL, loops compiled for instruction sets, and Embree's library.
    const ALLOWED: &[&str] = &[
        "accel/wide/simd/mod.rs",
        "array.rs",
        "editor/viewport/gl.rs",
        "math/simd.rs",
        "measure/peers/embree/library.rs",
    ];
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let allows = |file: &PathBuf| std::fs::read_to_string(file).unwrap().contains("(unsafe_code");
    let mut found: Vec<_> = files
        .into_iter()
        .filter(allows)
        .map(|file| file.strip_prefix(&src).unwrap().to_string_lossy().replace('\\', "/"))
        .collect();
    found.sort();
    assert_eq!(found, ALLOWED);
}

/// Rows of the page about imports: what is read, and the tests that it names.
fn rows_of_imports() -> Vec<(String, Vec<String>)> {
    let page = include_str!("../src/manual/imports.md");
    let rows = page.lines().filter(|line| line.starts_with("| ") && line.ends_with('|'));
    let cells = rows.map(|row| row.trim_matches('|').split('|').map(str::trim).collect::<Vec<_>>());
    let cells = cells.filter(|cells| cells.last() != Some(&"test"));
    cells
        .map(|cells| {
            let tests = cells.last().unwrap().split('`').skip(1).step_by(2).map(str::to_owned).collect();
            (cells[0].to_owned(), tests)
        })
        .collect()
}

#[test]
fn every_row_about_imports_names_tests_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    rust_files(&root.join("src/formats"), &mut files);
    rust_files(&root.join("tests"), &mut files);
    let sources: Vec<String> = files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    let is_test = |name: &str| {
        let head = format!("fn {name}()");
        let follows = |before: &str| before.trim_end().ends_with("#[test]");
        sources.iter().any(|source| source.match_indices(&head).any(|(at, _)| follows(&source[..at])))
    };
    let rows = rows_of_imports();
    assert!(rows.len() > 60, "{} rows", rows.len());
    for (feature, tests) in rows {
        assert!(!tests.is_empty(), "{feature}: no test");
        for test in tests {
            assert!(is_test(&test), "{feature}: there is no test `{test}`");
        }
    }
}
