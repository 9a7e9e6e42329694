//! Files that OBJ and MTL files name.

use std::path::{Component, Path, PathBuf};

use crate::formats::surroundings::{OUTSIDE, Surroundings};

/// The file that `name` means, seen from `folder`; `None` if there is none.
///
/// Backslashes separate folders as slashes do, and quotation marks around the name are left out. A name whose case does
/// not match finds the first file, in alphabetical order, that matches otherwise. A path that leads nowhere, such as
/// one on the drive of whoever wrote the file or outside the model's surroundings, finds a file of that name in `folder`
/// itself.
pub(super) fn find_file(folder: &Path, name: &str, surroundings: &Surroundings) -> Option<PathBuf> {
    let name = portable(name);
    let last = name.rsplit('/').next()?;
    if last.is_empty() {
        return None;
    }
    // `join` with an empty folder would make relative names absolute nowhere; "." is the same folder by its name.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let named = || find_exact(folder, &name).or_else(|| find_any_case(folder, &name));
    // Nothing outside is looked at, not even for being there.
    surroundings.admits(&folder.join(&name)).then(named).flatten().or_else(|| find_any_case(folder, last))
}

/// Why [`find_file`] found nothing, to follow the file's name in a message.
pub(super) fn absence(folder: &Path, name: &str, surroundings: &Surroundings) -> &'static str {
    if surroundings.admits(&folder.join(portable(name))) { "is missing" } else { OUTSIDE }
}

/// The name with slashes and without quotation marks.
fn portable(name: &str) -> String {
    name.trim().trim_matches('"').replace('\\', "/")
}

fn find_exact(folder: &Path, name: &str) -> Option<PathBuf> {
    Some(folder.join(name)).filter(|path| path.is_file())
}

fn find_any_case(folder: &Path, name: &str) -> Option<PathBuf> {
    let mut path = folder.to_path_buf();
    for component in Path::new(name).components() {
        match component {
            Component::Normal(part) if !path.join(part).exists() => {
                let wanted = part.to_str()?.to_lowercase();
                let matches = |entry: std::io::Result<std::fs::DirEntry>| {
                    let name = entry.ok()?.file_name();
                    (name.to_str()?.to_lowercase() == wanted).then_some(name)
                };
                // Folders are read in no particular order; the least name is the same everywhere.
                let found = std::fs::read_dir(&path).ok()?.filter_map(matches).min()?;
                path.push(found);
            }
            Component::CurDir => {}
            component => path.push(component),
        }
    }
    path.is_file().then_some(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::LoadOptions;

    #[test]
    fn names_are_found_whatever_their_slashes_case_and_drive() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        std::fs::create_dir(folder.join("Maps")).unwrap();
        for file in ["Maps/Wood Floor.png", "a.mtl", "A.MTL"] {
            std::fs::write(folder.join(file), "").unwrap();
        }
        let found = |name: &str| {
            let surroundings = Surroundings::new(folder, &LoadOptions::default());
            let path = find_file(folder, name, &surroundings)?;
            Some(path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned())
        };
        let wood = Some("Maps/Wood Floor.png".to_owned());
        for name in ["Maps/Wood Floor.png", "Maps\\Wood Floor.png", "./maps/WOOD floor.PNG", "\"maps\\wood floor.png\""]
        {
            assert_eq!(found(name), wood, "{name}");
        }
        assert_eq!(found("a.mtl").as_deref(), Some("a.mtl"), "an exact match goes first");
        assert_eq!(found("C:\\work\\a.mtl").as_deref(), Some("a.mtl"));
        assert_eq!(found("/nowhere/a.mtl").as_deref(), Some("a.mtl"));
        for name in ["", " ", "maps", "maps/", "b.mtl", "\\"] {
            assert_eq!(found(name), None, "{name}");
        }
    }

    #[test]
    fn files_outside_the_models_folder_are_found_only_where_that_is_allowed() {
        let outer = tempfile::tempdir().unwrap();
        let model = outer.path().join("model");
        let maps = model.join("maps");
        std::fs::create_dir_all(&maps).unwrap();
        for file in [outer.path().join("a.png"), model.join("b.png"), maps.join("c.png")] {
            std::fs::write(file, "").unwrap();
        }
        let strict = Surroundings::new(&model, &LoadOptions::default());
        let loose = Surroundings { allow_external: true, ..strict.clone() };
        let absolute = |path: &str| outer.path().join(path).to_str().unwrap().to_owned();
        // Names are seen from the folder of the library; what counts is the folder of the model.
        for (name, inside) in [
            ("../b.png".to_owned(), true),
            (absolute("model/b.png"), true),
            ("../../a.png".into(), false),
            ("..\\..\\A.png".into(), false),
            (absolute("a.png"), false),
        ] {
            assert_eq!(find_file(&maps, &name, &strict).is_some(), inside, "{name}");
            assert_eq!(absence(&maps, &name, &strict) == "is missing", inside, "{name}");
            assert!(find_file(&maps, &name, &loose).is_some(), "{name}");
        }
        let elsewhere = find_file(&maps, "/of/another/machine/c.png", &strict);
        assert_eq!(elsewhere, Some(maps.join("c.png")), "the name alone, beside the library");
    }
}
