//! What of a scene file can be selected and changed.

use serde::{Deserialize, Serialize};

/// A kind of table in a scene file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The file's own fields: `ambient`.
    Scene,
    /// `[film]`.
    Film,
    /// `[background]`.
    Background,
    /// `[[camera]]`.
    Camera,
    /// `[[light]]`.
    Light,
    /// `[[material]]`.
    Material,
    /// `[[object]]`.
    Object,
    /// `[[override]]`.
    Override,
}

impl Kind {
    /// The kinds of which there may be several.
    pub const LISTS: [Self; 5] = [Self::Camera, Self::Light, Self::Material, Self::Object, Self::Override];

    /// The key of its table or tables; nothing for the file itself.
    pub fn key(self) -> &'static str {
        match self {
            Self::Scene => "",
            Self::Film => "film",
            Self::Background => "background",
            Self::Camera => "camera",
            Self::Light => "light",
            Self::Material => "material",
            Self::Object => "object",
            Self::Override => "override",
        }
    }

    /// Whether there may be several.
    pub fn is_list(self) -> bool {
        Self::LISTS.contains(&self)
    }
}

/// One table of a scene file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Item {
    /// What it is.
    pub kind: Kind,
    /// Its position among those of its kind, from 0; 0 where there is one at most.
    #[serde(default)]
    pub index: usize,
}

impl Item {
    /// The one at this position of its kind.
    pub const fn new(kind: Kind, index: usize) -> Self {
        Self { kind, index }
    }

    /// The only one of its kind.
    pub const fn only(kind: Kind) -> Self {
        Self { kind, index: 0 }
    }

    /// An object.
    pub const fn object(index: usize) -> Self {
        Self { kind: Kind::Object, index }
    }

    /// A light.
    pub const fn light(index: usize) -> Self {
        Self { kind: Kind::Light, index }
    }

    /// A material.
    pub const fn material(index: usize) -> Self {
        Self { kind: Kind::Material, index }
    }
}
