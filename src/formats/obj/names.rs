//! The names of an OBJ file's objects and groups, and from which face on they hold.

use std::collections::HashMap;
use std::sync::Arc;

use crate::geometry::mesh::Group;

/// What faces before the first name are called: the name that the format gives them.
const DEFAULT: &str = "default";

/// Names as they come.
#[derive(Default)]
pub(super) struct Names {
    /// How many `o` statements there were.
    pub objects: u64,
    /// How many `g` statements there were.
    pub groups: u64,
    object: String,
    group: String,
    /// From which face on which name holds.
    runs: Vec<(usize, Arc<str>)>,
    known: HashMap<String, Arc<str>>,
}

impl Names {
    /// `o`: the faces from this one on belong to an object, and to no group so far.
    pub fn object(&mut self, name: &str, face: usize) {
        self.objects += 1;
        name.clone_into(&mut self.object);
        self.group.clear();
        self.start(face);
    }

    /// `g`: the faces from this one on belong to a group, or to several.
    pub fn group(&mut self, name: &str, face: usize) {
        self.groups += 1;
        name.clone_into(&mut self.group);
        self.start(face);
    }

    fn start(&mut self, face: usize) {
        let name = match (self.object.as_str(), self.group.as_str()) {
            ("", "") => DEFAULT.to_owned(),
            (name, "") | ("", name) => name.to_owned(),
            (object, group) => format!("{object}/{group}"),
        };
        let name = match self.known.get(&name) {
            Some(known) => known.clone(),
            None => {
                let shared: Arc<str> = name.as_str().into();
                self.known.insert(name, shared.clone());
                shared
            }
        };
        match self.runs.last_mut() {
            Some(last) if last.0 == face => last.1 = name,
            Some(last) if last.1 == name => {}
            _ => self.runs.push((face, name)),
        }
    }

    /// The groups of triangles, where faces have so many corners; none for a file without names.
    pub fn groups(&self, corner_counts: impl Iterator<Item = usize>) -> Vec<Group> {
        let unnamed = (self.runs.first().is_some_and(|run| run.0 > 0)).then(|| (0, DEFAULT.into()));
        let mut groups: Vec<Group> = Vec::new();
        let mut runs = unnamed.into_iter().chain(self.runs.iter().cloned()).peekable();
        let mut triangles = 0;
        for (face, corners) in corner_counts.enumerate() {
            if let Some((_, name)) = runs.next_if(|run| run.0 == face)
                && groups.last().is_none_or(|last| last.name != name)
            {
                groups.push(Group { name, first_triangle: triangles });
            }
            triangles += corners as u32 - 2;
        }
        groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_runs_of_triangles() {
        let mut names = Names::default();
        names.object("house", 1);
        names.group("roof a", 3);
        names.group("wall", 5);
        names.group("door", 5);
        names.object("tree", 6);
        names.group("", 7);
        let groups = names.groups([3, 4, 3, 3, 5, 3, 3, 3].into_iter());
        let found: Vec<_> = groups.iter().map(|group| (&*group.name, group.first_triangle)).collect();
        let expected = [("default", 0), ("house", 1), ("house/roof a", 4), ("house/door", 8), ("tree", 9)];
        assert_eq!(found, expected);
        assert!(Names::default().groups([3, 3].into_iter()).is_empty());
    }
}
