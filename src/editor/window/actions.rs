//! Everything that menus, the toolbar and keys can do: one entry each.

use eframe::egui::{Key, KeyboardShortcut, Modifiers};

use crate::editor::gizmo::Tool;
use crate::scene::auto::View;

/// A new object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NewObject {
    /// `sphere`
    Sphere,
    /// `ellipsoid`
    Ellipsoid,
    /// `cylinder`
    Cylinder,
    /// `cone`
    Cone,
    /// `paraboloid`
    Paraboloid,
    /// `hyperboloid_one_sheet`
    HyperboloidOneSheet,
    /// `hyperboloid_two_sheets`
    HyperboloidTwoSheets,
    /// `plane`
    Plane,
    /// `quadric`
    Quadric,
    /// `builtin = "box"`
    Box,
    /// `builtin = "torus"`
    Torus,
    /// `builtin = "teapot"`
    Teapot,
}

impl NewObject {
    /// All of them, quadrics first, and what they are called.
    pub const ALL: [(Self, &'static str); 12] = [
        (Self::Sphere, "Sphere"),
        (Self::Ellipsoid, "Ellipsoid"),
        (Self::Cylinder, "Cylinder"),
        (Self::Cone, "Cone"),
        (Self::Paraboloid, "Paraboloid"),
        (Self::HyperboloidOneSheet, "Hyperboloid, one sheet"),
        (Self::HyperboloidTwoSheets, "Hyperboloid, two sheets"),
        (Self::Plane, "Plane"),
        (Self::Quadric, "General quadric"),
        (Self::Box, "Box"),
        (Self::Torus, "Torus"),
        (Self::Teapot, "Teapot"),
    ];
}

/// A new light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NewLight {
    /// `kind = "point"`
    Point,
    /// `kind = "directional"`
    Directional,
    /// `kind = "spot"`
    Spot,
}

impl NewLight {
    /// All of them, and what they are called.
    pub const ALL: [(Self, &'static str); 3] =
        [(Self::Point, "Point light"), (Self::Directional, "Directional light"), (Self::Spot, "Spot light")];
}

/// What can be done.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub enum Action {
    New,
    Open,
    Save,
    SaveAs,
    Import,
    SavePicture,
    Quit,
    Undo,
    Redo,
    Duplicate,
    Delete,
    Hide,
    SelectAll,
    SelectNone,
    AddObject(NewObject),
    AddLight(NewLight),
    Texture,
    Tool(Tool),
    FrameSelected,
    FrameAll,
    Look(View),
    ToggleProjection,
    ToggleGrid,
    ToggleWireframe,
    ToggleTheme,
    RenderFull,
    RenderRegion,
    StopRender,
    ClearRender,
    ExplainPixel,
    ShowKeys,
    ShowAbout,
}

/// A menu of the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Menu {
    File,
    Edit,
    Add,
    View,
    Tool,
    Help,
}

impl Menu {
    /// All of them, in order, with their titles.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::File, "File"),
        (Self::Edit, "Edit"),
        (Self::Add, "Add"),
        (Self::View, "View"),
        (Self::Tool, "Tool"),
        (Self::Help, "Help"),
    ];
}

/// How an action is found and called.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// What it does.
    pub action: Action,
    /// The menu that it is in.
    pub menu: Menu,
    /// What the menu calls it.
    pub label: &'static str,
    /// What it does, for the toolbar's tooltips and the list of keys.
    pub about: &'static str,
    /// The keys that call it.
    pub keys: Option<KeyboardShortcut>,
    /// What the toolbar calls it; nothing where it is not there.
    pub short: &'static str,
}

const NONE: Modifiers = Modifiers::NONE;
const COMMAND: Modifiers = Modifiers::COMMAND;
const SHIFT: Modifiers = Modifiers::SHIFT;
const COMMAND_SHIFT: Modifiers = Modifiers { shift: true, ..Modifiers::COMMAND };

const fn entry(
    menu: Menu,
    action: Action,
    label: &'static str,
    about: &'static str,
    keys: Option<(Modifiers, Key)>,
    short: &'static str,
) -> Entry {
    let keys = match keys {
        Some((modifiers, key)) => Some(KeyboardShortcut::new(modifiers, key)),
        None => None,
    };
    Entry { action, menu, label, about, keys, short }
}

/// All actions but those of the Add menu's objects and lights, in the order of the menus.
pub const ENTRIES: &[Entry] = &[
    entry(Menu::File, Action::New, "New", "Start a new scene", Some((COMMAND, Key::N)), "New"),
    entry(Menu::File, Action::Open, "Open…", "Open a scene or a model", Some((COMMAND, Key::O)), "Open"),
    entry(Menu::File, Action::Import, "Import model…", "Add an OBJ or glTF model", Some((COMMAND, Key::I)), ""),
    entry(Menu::File, Action::Save, "Save", "Save the scene", Some((COMMAND, Key::S)), "Save"),
    entry(Menu::File, Action::SaveAs, "Save as…", "Save under another name", Some((COMMAND_SHIFT, Key::S)), ""),
    entry(Menu::File, Action::SavePicture, "Save picture…", "Save what was rendered", Some((COMMAND, Key::P)), ""),
    entry(Menu::File, Action::Quit, "Quit", "Close the editor", Some((COMMAND, Key::Q)), ""),
    entry(Menu::Edit, Action::Undo, "Undo", "Take the last change back", Some((COMMAND, Key::Z)), "Undo"),
    entry(Menu::Edit, Action::Redo, "Redo", "Do it again", Some((COMMAND_SHIFT, Key::Z)), "Redo"),
    entry(Menu::Edit, Action::Duplicate, "Duplicate", "Copy what is selected", Some((COMMAND, Key::D)), ""),
    entry(Menu::Edit, Action::Delete, "Delete", "Delete what is selected", Some((NONE, Key::Delete)), ""),
    entry(Menu::Edit, Action::Hide, "Hide or show", "Hide what is selected, or show it", Some((NONE, Key::H)), ""),
    entry(Menu::Edit, Action::SelectAll, "Select all", "Select every object", Some((COMMAND, Key::A)), ""),
    entry(Menu::Edit, Action::SelectNone, "Select none", "Select nothing", Some((COMMAND_SHIFT, Key::A)), ""),
    entry(
        Menu::Edit,
        Action::Texture,
        "Texture…",
        "Choose an image for what is selected",
        Some((NONE, Key::T)),
        "Texture",
    ),
    entry(Menu::View, Action::FrameSelected, "Frame selected", "Look at what is selected", Some((NONE, Key::F)), ""),
    entry(Menu::View, Action::FrameAll, "Frame all", "Look at everything", Some((NONE, Key::Home)), "Frame"),
    entry(Menu::View, Action::Look(View::Front), "Front", "Look from the front", Some((NONE, Key::Num1)), ""),
    entry(Menu::View, Action::Look(View::Back), "Back", "Look from behind", Some((SHIFT, Key::Num1)), ""),
    entry(Menu::View, Action::Look(View::Right), "Right", "Look from the right", Some((NONE, Key::Num3)), ""),
    entry(Menu::View, Action::Look(View::Left), "Left", "Look from the left", Some((SHIFT, Key::Num3)), ""),
    entry(Menu::View, Action::Look(View::Top), "Top", "Look from above", Some((NONE, Key::Num7)), ""),
    entry(Menu::View, Action::Look(View::Bottom), "Bottom", "Look from below", Some((SHIFT, Key::Num7)), ""),
    entry(
        Menu::View,
        Action::ToggleProjection,
        "Perspective or orthographic",
        "Change the projection",
        Some((NONE, Key::Num5)),
        "",
    ),
    entry(Menu::View, Action::ToggleGrid, "Grid", "Show or hide the grid", Some((NONE, Key::G)), ""),
    entry(Menu::View, Action::ToggleWireframe, "Wireframe", "Show the edges", Some((NONE, Key::Z)), ""),
    entry(Menu::View, Action::ToggleTheme, "Light or dark", "Change the window's theme", None, ""),
    entry(
        Menu::Tool,
        Action::Tool(Tool::Select),
        "Select",
        "Select objects and lights",
        Some((NONE, Key::Q)),
        "Select",
    ),
    entry(Menu::Tool, Action::Tool(Tool::Move), "Move", "Move what is selected", Some((NONE, Key::W)), "Move"),
    entry(Menu::Tool, Action::Tool(Tool::Rotate), "Rotate", "Turn what is selected", Some((NONE, Key::E)), "Rotate"),
    entry(Menu::Tool, Action::Tool(Tool::Scale), "Scale", "Scale what is selected", Some((NONE, Key::R)), "Scale"),
    entry(
        Menu::Tool,
        Action::RenderFull,
        "Render Full Window",
        "Ray trace the whole picture",
        Some((NONE, Key::F5)),
        "Render",
    ),
    entry(
        Menu::Tool,
        Action::RenderRegion,
        "Render Region",
        "Ray trace a rectangle: drag it in the view",
        Some((NONE, Key::F6)),
        "Region",
    ),
    entry(Menu::Tool, Action::StopRender, "Stop", "Stop rendering", Some((NONE, Key::Escape)), "Stop"),
    entry(Menu::Tool, Action::ClearRender, "Clear picture", "Show the view again", Some((NONE, Key::F7)), ""),
    entry(
        Menu::Tool,
        Action::ExplainPixel,
        "Explain a pixel",
        "Click a rendered pixel to see why it has its colour",
        Some((NONE, Key::F8)),
        "Explain",
    ),
    entry(Menu::Help, Action::ShowKeys, "Keys", "All keyboard shortcuts", Some((NONE, Key::F1)), ""),
    entry(Menu::Help, Action::ShowAbout, "About", "What this is", None, ""),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_keys_call_two_actions() {
        let mut seen = Vec::new();
        for entry in ENTRIES {
            if let Some(keys) = entry.keys {
                assert!(!seen.contains(&keys), "{keys:?}");
                seen.push(keys);
            }
        }
    }
}
