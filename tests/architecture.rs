//! The import rule: data flows one way. Reads the source and fails on a backward `crate::` path.

use std::path::{Path, PathBuf};

/// Modules in layers; a module may use those of lower layers and itself, not its neighbours.
const LAYERS: &[&[&str]] = &[
    &["error", "progress", "math"],
    &["geometry"],
    &["scene", "accel"],
    &["render"],
    &["formats"],
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
