//! The panel on the right: what the selected item is, field by field.

use eframe::egui::{self, Ui};
use glam::DVec3;
use toml::Value;

use super::ball::Ball;
use super::edits::{Ask, Edits, short};
use super::widgets::{Number, choice, colored, flag, grid, point, row, three, weighted, whole};
use super::{outliner, shapes};
use crate::editor::command::place_of;
use crate::editor::navigate::Looking;
use crate::editor::numbers::tidy;
use crate::editor::placement::{Place, Placement, number};
use crate::editor::presets::PRESETS;
use crate::editor::{Command, Item, Kind, Session};
use crate::scene::{Clamp, Falloff, LightKind, Material, Projection, Shape, Transfer};

/// What the panel has found out of what it shows.
#[derive(Default)]
pub struct Memory {
    ball: Ball,
    /// The materials of its file that an object has, and of which revision of the scene.
    imported: Option<(u64, usize, Vec<usize>)>,
}

impl Memory {
    fn imported(&mut self, session: &Session, object: usize) -> &[usize] {
        let revision = session.revision();
        if self.imported.as_ref().is_none_or(|(known, of, _)| (*known, *of) != (revision, object)) {
            self.imported = Some((revision, object, session.imported_materials(object)));
        }
        self.imported.as_ref().map_or(&[], |(.., materials)| materials)
    }
}

/// Shows the selected items' fields, those of the film, the background and the camera.
pub fn show(ui: &mut Ui, session: &Session, edits: &mut Edits, memory: &mut Memory) {
    egui::ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        let selected: Vec<Item> = session.selection().iter().copied().collect();
        match selected.as_slice() {
            [] => {
                ui.weak("Nothing is selected.");
            }
            [one] => match one.kind {
                Kind::Object => object(ui, session, *one, edits, memory),
                Kind::Light => {
                    heading(ui, session, *one, edits);
                    light(ui, session, *one, edits);
                }
                Kind::Material => {
                    heading(ui, session, *one, edits);
                    own_material(ui, session, *one, edits, memory);
                }
                _ => heading(ui, session, *one, edits),
            },
            several => several_items(ui, session, several, edits),
        }
        ui.separator();
        ui.collapsing("Camera", |ui| camera(ui, session, edits));
        ui.collapsing("Picture", |ui| film(ui, session, edits));
        ui.collapsing("Surroundings", |ui| surroundings(ui, session, edits));
    });
}

/// The item's name, which can be changed.
fn heading(ui: &mut Ui, session: &Session, item: Item, edits: &mut Edits) {
    let title = outliner::title(session, item);
    ui.horizontal(|ui| {
        let label = ui.strong(match item.kind {
            Kind::Object => "Object",
            Kind::Light => "Light",
            Kind::Material => "Material",
            _ => "Camera",
        });
        let id = ui.scope_id().with(("name", item));
        let mut name = ui.data(|data| data.get_temp::<String>(id)).unwrap_or_else(|| title.clone());
        let response = ui.text_edit_singleline(&mut name).labelled_by(label.id);
        if response.lost_focus() {
            ui.data_mut(|data| data.remove::<String>(id));
            if !name.is_empty() && name != title {
                edits.apply(Command::Rename { item, name });
            }
        } else if response.has_focus() {
            ui.data_mut(|data| data.insert_temp(id, name));
        } else {
            ui.data_mut(|data| data.remove::<String>(id));
        }
    });
}

fn several_items(ui: &mut Ui, session: &Session, items: &[Item], edits: &mut Edits) {
    ui.strong(format!("{} items", items.len()));
    for item in items {
        ui.label(outliner::title(session, *item));
    }
    let objects: Vec<Item> = items.iter().copied().filter(|item| item.kind == Kind::Object).collect();
    if objects.is_empty() {
        return;
    }
    ui.horizontal(|ui| {
        ui.label("Material of all");
        let names = session.document().names(Kind::Material);
        egui::ComboBox::from_id_salt("material of all").selected_text("choose").show_ui(ui, |ui| {
            for name in names {
                if ui.selectable_label(false, &name).clicked() {
                    let set = |object: &Item| Command::set(*object, &["material"], name.as_str());
                    edits.apply(Command::All(objects.iter().map(set).collect()));
                }
            }
        });
    });
}

fn object(ui: &mut Ui, session: &Session, item: Item, edits: &mut Edits, memory: &mut Memory) {
    heading(ui, session, item, edits);
    grid(ui, ("shape", item), |ui| {
        shapes::show(ui, session.document(), item, edits);
        row(ui, "visible", |ui, id| {
            let mut is_visible = session.is_visible(item.index);
            if ui.checkbox(&mut is_visible, "").labelled_by(id).changed() {
                edits.apply(match is_visible {
                    true => Command::unset(item, &["visible"]),
                    false => Command::set(item, &["visible"], false),
                });
            }
        });
    });
    ui.separator();
    placement(ui, session, item, edits);
    ui.separator();
    material_of(ui, session, item, edits, memory);
}

fn placement(ui: &mut Ui, session: &Session, item: Item, edits: &mut Edits) {
    let Ok((place, _)) = place_of(session.document(), item) else { return };
    let Place::Simple(placement) = place else {
        ui.label("The transform shears: it is a matrix in the scene file. Move, Rotate and Scale change it.");
        return;
    };
    let command = |placement: Placement| match Place::Simple(placement).write() {
        Some(value) => Command::set(item, &["transform"], value),
        None => Command::unset(item, &["transform"]),
    };
    grid(ui, ("placement", item), |ui| {
        three(ui, "position", placement.translate, 0.01, |response, translate| {
            edits.moving(response, command(Placement { translate, ..placement }));
        });
        three(ui, "rotation", placement.rotate, 0.5, |response, rotate| {
            edits.moving(response, command(Placement { rotate, ..placement }));
        });
        three(ui, "scale", placement.scale, 0.005, |response, scale| {
            if scale.abs().min_element() > 0.0 {
                edits.moving(response, command(Placement { scale, ..placement }));
            }
        });
    });
}

/// What gives an object another material, or the fields of one that is made for it.
fn material_of(ui: &mut Ui, session: &Session, object: Item, edits: &mut Edits, memory: &mut Memory) {
    let document = session.document();
    let names = document.names(Kind::Material);
    let own = document.string(object, "material");
    let is_mesh =
        session.instances(object.index).any(|number| matches!(session.scene().objects[number].shape, Shape::Mesh(_)));
    let none = if is_mesh { "of the file" } else { "none: matt grey" };
    ui.horizontal(|ui| {
        ui.strong("Material");
        egui::ComboBox::from_id_salt(("material", object)).selected_text(own.as_deref().unwrap_or(none)).show_ui(
            ui,
            |ui| {
                if ui.selectable_label(own.is_none(), none).clicked() {
                    edits.apply(Command::unset(object, &["material"]));
                }
                for name in &names {
                    if ui.selectable_label(own.as_deref() == Some(name), name).clicked() {
                        edits.apply(Command::set(object, &["material"], name.as_str()));
                    }
                }
            },
        );
        if ui.button("New").on_hover_text("Give it a material of its own").clicked() {
            let title = outliner::title(session, object);
            edits.apply(new_material(session, &[object], &title, Vec::new()));
        }
    });
    presets(ui, session, object, own.as_deref(), edits);
    let number = own.and_then(|own| names.iter().position(|name| *name == own));
    match number {
        Some(index) => own_material(ui, session, Item::material(index), edits, memory),
        None if is_mesh => imported_materials(ui, session, memory.imported(session, object.index), edits),
        None => {}
    }
}

/// What makes a material for objects.
pub fn new_material(session: &Session, objects: &[Item], name: &str, fields: Vec<(String, Value)>) -> Command {
    let name = session.document().free_name(Kind::Material, name);
    let mut all = vec![("name".to_owned(), Value::from(name.clone()))];
    all.extend(fields);
    if all.len() == 1 {
        all.push(("diffuse".to_owned(), Value::Float(0.8)));
    }
    let mut commands = vec![Command::Add { kind: Kind::Material, fields: all }];
    commands.extend(objects.iter().map(|object| Command::set(*object, &["material"], name.as_str())));
    Command::All(commands)
}

fn presets(ui: &mut Ui, session: &Session, object: Item, own: Option<&str>, edits: &mut Edits) {
    ui.horizontal_wrapped(|ui| {
        for preset in PRESETS {
            if !ui.small_button(preset.name).on_hover_text("Make it of this").clicked() {
                continue;
            }
            let index =
                own.and_then(|own| session.document().names(Kind::Material).iter().position(|name| name == own));
            edits.apply(match index {
                Some(index) => Command::All(
                    preset
                        .fields()
                        .into_iter()
                        .map(|(key, value)| Command::set(Item::material(index), &[&key], value))
                        .collect(),
                ),
                None => new_material(session, &[object], preset.name, preset.fields()),
            });
        }
    });
}

fn own_material(ui: &mut Ui, session: &Session, item: Item, edits: &mut Edits, memory: &mut Memory) {
    let Some(material) = session.material(item.index) else { return };
    memory.ball.show(ui, material);
    terms(ui, session, item, material, edits);
}

/// The materials that a mesh's file gives: each is changed by an `[[override]]`.
fn imported_materials(ui: &mut Ui, session: &Session, imported: &[usize], edits: &mut Edits) {
    let materials = &session.scene().materials;
    for material in imported.iter().filter_map(|&number| materials.get(number)) {
        ui.collapsing(&material.name, |ui| {
            let overrides = session.document().count(Kind::Override);
            let index = (0..overrides).find(|&index| {
                session.document().string(Item::new(Kind::Override, index), "material").as_deref()
                    == Some(&material.name)
            });
            match index {
                Some(index) => terms(ui, session, Item::new(Kind::Override, index), material, edits),
                None => {
                    if ui.button("Change").on_hover_text("Change it for this scene").clicked() {
                        let fields = vec![("material".to_owned(), Value::from(material.name.as_str()))];
                        edits.apply(Command::Add { kind: Kind::Override, fields });
                    }
                }
            }
        });
    }
}

/// The terms of the shading formula.
fn terms(ui: &mut Ui, session: &Session, item: Item, material: &Material, edits: &mut Edits) {
    let document = session.document();
    grid(ui, ("terms", item), |ui| {
        let ambient = material.ambient.unwrap_or(session.scene().ambient * material.diffuse);
        weighted(ui, edits, "ambient", item, &["ambient"], ambient);
        weighted(ui, edits, "diffuse", item, &["diffuse"], material.diffuse);
        weighted(ui, edits, "specular", item, &["specular"], material.specular);
        weighted(ui, edits, "ks (highlight)", item, &["ks"], material.ks);
        Number { max: 1e6, min: 0.0, ..Number::any(short(material.shininess)) }.show(
            ui,
            edits,
            "shininess",
            item,
            &["shininess"],
        );
        weighted(ui, edits, "reflectance", item, &["kr"], material.kr);
        row(ui, "opacity", |ui, id| {
            let before = 1.0 - short(material.kt.max_element());
            let mut opacity = before;
            let drag = egui::DragValue::new(&mut opacity).speed(0.005).range(0.0..=1.0).update_while_editing(false);
            let response = ui.add(drag).labelled_by(id);
            if response.changed() && opacity != before {
                let kt = tidy(1.0 - opacity);
                let mut commands = vec![Command::unset(item, &["opacity"]), Command::set(item, &["kt"], kt)];
                // Together they must not make light.
                if kt + short(material.kr.max_element()) > 1.0 {
                    commands.push(Command::set(item, &["kr"], tidy(1.0 - kt)));
                }
                edits.moving(&response, Command::All(commands));
            }
        });
        Number { min: 0.01, max: 100.0, ..Number::any(short(material.ior)) }.show(
            ui,
            edits,
            "refraction",
            item,
            &["ior"],
        );
        weighted(ui, edits, "emission", item, &["emission"], material.emission);
        row(ui, "texture", |ui, _| {
            let file = document.string(item, "texture").or_else(|| {
                document.value(item, &["texture", "file"]).and_then(|value| value.as_str().map(str::to_owned))
            });
            if ui.button(file.as_deref().unwrap_or("choose…")).clicked() {
                edits.list.push(Ask::ChooseTexture(item));
            }
            if file.is_some() && ui.small_button("none").on_hover_text("Without an image").clicked() {
                edits.apply(Command::unset(item, &["texture"]));
            }
        });
        flag(ui, edits, "flat", item, &["flat"], material.flat);
    });
}

fn light(ui: &mut Ui, session: &Session, item: Item, edits: &mut Edits) {
    let Some(light) = session.scene().lights.get(item.index) else { return };
    let document = session.document();
    let has = |key: &str| document.value(item, &[key]).is_some();
    grid(ui, ("light", item), |ui| {
        let intensity = document.value(item, &["intensity"]).as_ref().and_then(number);
        let color = intensity.filter(|factor| *factor > 0.0).map_or(light.color, |factor| light.color / factor as f32);
        colored(ui, edits, "color", item, &["color"], color);
        Number { min: 0.0, ..Number::any(intensity.unwrap_or(1.0)) }.show(ui, edits, "intensity", item, &["intensity"]);
        let falloff = match light.kind {
            LightKind::Point { position, falloff } => {
                point(ui, edits, "position", item, &["position"], position);
                Some(falloff)
            }
            LightKind::Directional { direction } => {
                point(ui, edits, "direction", item, &["direction"], direction);
                None
            }
            LightKind::Spot { position, direction, inner_angle, outer_angle, falloff } => {
                point(ui, edits, "position", item, &["position"], position);
                if has("target") {
                    point(ui, edits, "target", item, &["target"], position + direction);
                } else {
                    point(ui, edits, "direction", item, &["direction"], direction);
                }
                let degrees = |radians: f64| tidy(radians.to_degrees());
                Number::between(degrees(inner_angle), 0.0, degrees(outer_angle)).show(
                    ui,
                    edits,
                    "inner angle",
                    item,
                    &["inner_angle"],
                );
                Number::between(degrees(outer_angle), degrees(inner_angle), 90.0).show(
                    ui,
                    edits,
                    "outer angle",
                    item,
                    &["outer_angle"],
                );
                Some(falloff)
            }
        };
        if let Some(falloff) = falloff {
            let word = match falloff {
                Falloff::None => "none",
                Falloff::InverseSquare => "inverse_square",
            };
            choice(ui, edits, "falloff", item, &["falloff"], word, &["none", "inverse_square"]);
        }
    });
}

fn camera(ui: &mut Ui, session: &Session, edits: &mut Edits) {
    let scene = session.scene();
    let looking = Looking::of(scene.camera());
    if session.document().count(Kind::Camera) == 0 {
        ui.weak("The camera is automatic until the view is moved.");
        return;
    }
    let item = Item::new(Kind::Camera, scene.active_camera);
    if session.document().value(item, &["viewpoint"]).is_some() {
        ui.weak("A four-point camera: moving the view makes it a perspective one.");
        return;
    }
    grid(ui, "camera", |ui| {
        point(ui, edits, "eye", item, &["eye"], looking.eye);
        point(ui, edits, "target", item, &["target"], looking.target);
        point(ui, edits, "up", item, &["up"], if looking.up == DVec3::ZERO { DVec3::Y } else { looking.up });
        match looking.projection {
            Projection::Perspective { fov_y } => {
                let degrees = tidy(fov_y.to_degrees());
                Number { speed: 0.1, min: 1.0, max: 170.0, value: degrees }.show(
                    ui,
                    edits,
                    "field of view",
                    item,
                    &["fov"],
                );
            }
            Projection::Orthographic { height } => {
                Number::positive(height).show(ui, edits, "height", item, &["height"]);
            }
        }
    });
}

fn film(ui: &mut Ui, session: &Session, edits: &mut Edits) {
    let film = &session.scene().film;
    let item = Item::only(Kind::Film);
    let has_size = session.document().value(item, &["size"]).is_some();
    grid(ui, "film", |ui| {
        row(ui, "size", |ui, id| {
            let mut size = [film.width, film.height];
            for side in &mut size {
                let drag = egui::DragValue::new(side).range(1..=8192u32).update_while_editing(false);
                ui.add(drag).labelled_by(id);
            }
            if size != [film.width, film.height] {
                let list = Value::Array(size.map(|n| Value::Integer(n.into())).to_vec());
                edits.apply(if has_size || session.document().value(item, &["width"]).is_none() {
                    Command::set(item, &["size"], list)
                } else {
                    Command::All(vec![
                        Command::set(item, &["width"], i64::from(size[0])),
                        Command::set(item, &["height"], i64::from(size[1])),
                    ])
                });
            }
        });
        whole(ui, edits, "samples", item, &["samples"], film.samples, 1..=4096);
        whole(ui, edits, "depth", item, &["max_depth"], film.max_depth, 0..=100);
        Number { speed: 0.02, ..Number::between(short(film.exposure), -20.0, 20.0) }.show(
            ui,
            edits,
            "exposure",
            item,
            &["exposure"],
        );
        let clamp = if film.clamp == Clamp::Shade { "shade" } else { "output" };
        choice(ui, edits, "clamp", item, &["clamp"], clamp, &["shade", "output"]);
        let transfer = if film.transfer == Transfer::Srgb { "srgb" } else { "linear" };
        choice(ui, edits, "transfer", item, &["transfer"], transfer, &["srgb", "linear"]);
    });
}

fn surroundings(ui: &mut Ui, session: &Session, edits: &mut Edits) {
    use crate::scene::Background;
    let scene = session.scene();
    let item = Item::only(Kind::Background);
    grid(ui, "surroundings", |ui| {
        weighted(ui, edits, "ambient", Item::only(Kind::Scene), &["ambient"], scene.ambient);
        match &scene.background {
            Background::Color(color) => colored(ui, edits, "background", item, &["color"], *color),
            Background::Gradient { bottom, top, .. } => {
                colored(ui, edits, "sky", item, &["gradient", "top"], *top);
                colored(ui, edits, "ground", item, &["gradient", "bottom"], *bottom);
            }
            Background::Image { intensity, .. } => {
                Number { min: 0.0, ..Number::any(short(*intensity)) }.show(
                    ui,
                    edits,
                    "image, times",
                    item,
                    &["intensity"],
                );
            }
            Background::Transparent => {
                row(ui, "background", |ui, _| ui.label("transparent"));
            }
        }
    });
}
