//! Long work and shared work: what of a picture is to be rendered here, what is done already, and when to stop.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use clap::{Args, ValueHint};
use serde_json::json;

use super::arguments::RenderArguments;
use super::outputs::{self, Outputs, Picture};
use super::precision::{AnyRenderer, Precision};
use super::terminal::{self, Terminal};
use super::values;
use crate::error::{Error, Result};
use crate::formats::{Built, Fingerprint, Ledger, LoadOptions, picture, scene_file};
use crate::job::merge::write_part;
use crate::job::{Header, Kept, Share};
use crate::render::{Film, RenderSettings, Tile};
use crate::scene::{Background, Camera, CameraPath, Scene};

/// Flags of `render` for work that is long, or shared.
#[derive(Debug, Args)]
#[command(next_help_heading = "Long jobs and many machines")]
pub struct JobArguments {
    /// Keep finished tiles in `OUT.tiles` while rendering, and go on with those that an earlier process kept there.
    #[arg(long)]
    pub resume: bool,
    /// Stop in good order after this time, such as 90s, 45m, 1h30m or 1:30:00, with exit code 75. With --resume, and for frames
    /// with --skip-existing, the same command goes on.
    #[arg(long, value_name = "TIME", value_parser = values::duration)]
    pub time_limit: Option<Duration>,
    /// Render the K-th of N equal shares: of a picture to `OUT.KofN.part`, for `whitted merge`; of frames, every N-th. `auto` takes
    /// both from a Slurm job array.
    #[arg(long, value_name = "K/N", value_parser = share)]
    pub part: Option<Share>,
    /// Render a picture for each of these frames, both ends included, with the camera moving along its path. OUT must contain
    /// `{frame}`; without -o it is the input's name with `.{frame}.png`.
    #[arg(long, value_name = "A..B", value_parser = values::frames, allow_hyphen_values = true, conflicts_with = "stats_json")]
    pub frames: Option<(i32, i32)>,
    /// Move the camera around its target, once in N frames; without --frames, from 0 to N - 1.
    #[arg(long, value_name = "N", value_parser = values::count(1..=1_000_000), conflicts_with = "stats_json")]
    pub turntable: Option<u32>,
    /// Leave pictures, or parts, alone that are there.
    #[arg(long, conflicts_with = "no_clobber")]
    pub skip_existing: bool,
}

/// A share, or that of the Slurm task that this process is.
fn share(text: &str) -> std::result::Result<Share, String> {
    match text {
        "auto" => Share::of_slurm_task(|name| std::env::var(name).ok()),
        _ => text.parse(),
    }
}

impl JobArguments {
    /// The first and the last frame.
    pub fn frame_range(&self) -> Option<(i32, i32)> {
        self.frames.or(self.turntable.map(|frames| (0, frames as i32 - 1)))
    }

    /// The frames of this process.
    pub fn frames_here(&self) -> Option<impl Iterator<Item = i32>> {
        let share = self.part.unwrap_or(Share { number: 1, of: 1 });
        self.frame_range().map(|(first, last)| share.frames(first, last))
    }

    /// Gives the active camera its path.
    ///
    /// # Errors
    /// A camera that cannot move, or, where frames are to be rendered, does not.
    pub fn move_camera(&self, scene: &mut Scene) -> Result<()> {
        let camera = &mut scene.cameras[scene.active_camera];
        if let Some(frames) = self.turntable {
            camera.path = Some(CameraPath::Turntable { frames });
        }
        let can_move = matches!(camera.camera, Camera::LookAt { .. });
        if self.frame_range().is_none() || (can_move && camera.path.is_some()) {
            return Ok(());
        }
        let name = &camera.name;
        Err(if can_move {
            Error::caller(format!("all frames would be the same: the camera `{name}` does not move"))
                .remedy("give it a `turntable` or a `path` in the scene file, or say --turntable N")
        } else {
            Error::caller(format!("the camera `{name}` cannot move: it sees through four points"))
                .remedy("choose another camera")
        })
    }

    /// The name of a part's file, after the picture's; frames have no parts.
    pub fn part_file(&self, picture: &Path) -> Option<PathBuf> {
        let Share { number, of } = self.part.filter(|_| self.frame_range().is_none())?;
        let width = of.to_string().len();
        Some(with_suffix(picture, &format!(".{number:0width$}of{of}.part")))
    }

    /// Whether tiles are written to files of their own.
    pub fn writes_tiles(&self) -> bool {
        self.resume || self.part.is_some()
    }
}

/// Where the tiles of a file that is to be written are kept.
pub fn kept_file(target: &Path) -> PathBuf {
    with_suffix(target, ".tiles")
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// What a scene was read from, and how.
pub struct Origin {
    fingerprint: Fingerprint,
    options: LoadOptions,
}

impl Origin {
    /// That of an input; a built scene's is that of what it was built from, so that both make parts of one picture.
    ///
    /// # Errors
    /// When a file of the scene cannot be read again.
    pub fn of(arguments: &RenderArguments, ledger: &Ledger, built: Option<&Built>) -> Result<Self> {
        Ok(match built {
            Some(built) => Self { fingerprint: built.fingerprint, options: built.options.clone() },
            None => Self {
                fingerprint: Fingerprint::of_files(&arguments.input, ledger.files())?,
                options: arguments.load.options(),
            },
        })
    }
}

/// What tells the picture from others: everything that changes a pixel, without a frame and a share.
pub fn header(origin: Origin, scene: &Scene, settings: &RenderSettings, precision: Precision) -> Header {
    let Origin { fingerprint, options } = origin;
    let settings_of_scene = json!({
        "camera": scene_file::camera_text(&scene.cameras[scene.active_camera]),
        "precision": precision,
        "normals": options.normals,
        "up": options.up,
        "crease_angle": options.crease_angle,
        "scene": options.scene,
        "animation": options.animation,
        "time": options.time,
        "cull_back_faces": options.cull_back_faces,
    });
    let serde_json::Value::Object(names) = settings_of_scene else { unreachable!("it is written as an object") };
    Header {
        version: env!("CARGO_PKG_VERSION").into(),
        scene: fingerprint,
        settings: names,
        film: scene.film,
        crop: settings.crop,
        aovs: settings.aovs.clone(),
        transparent: scene.background == Background::Transparent,
        frame: None,
        share: None,
    }
}

/// Renders what is not kept of a picture or a share, and keeps what is finished. The film has all tiles that are finished; it is complete if
/// those that the header asks for are. A share's file is written. What keeps tiles is for the caller to remove, once all is written.
///
/// # Errors
/// What is kept is of another picture, or is being kept by another process; those of rendering and writing.
pub fn render(
    renderer: &AnyRenderer,
    header: &Header,
    settings: &RenderSettings,
    target: &Path,
    resume: bool,
    progress: &Terminal,
) -> Result<(Film, Option<Kept>)> {
    let opened = if resume { Some(Kept::open(&kept_file(target), header)?) } else { None };
    let (kept, found) = opened.unzip();
    let found = found.unwrap_or_default();
    if let Some(at) = found.damaged {
        let path = kept_file(target);
        terminal::report(&format!(
            "warning: {}: the record at byte {at} is damaged or not whole: tiles of such records are rendered again",
            path.display()
        ));
    }
    let done: HashSet<u32> = found.tiles.iter().map(|tile| tile.number).collect();
    let missing = header.wanted()?.into_iter().filter(|number| !done.contains(number)).collect();
    let settings = RenderSettings {
        coverage: settings.coverage && found.tiles.is_empty(),
        tiles: Some(missing),
        ..settings.clone()
    };
    let own = Mutex::new(Vec::new());
    let finished = |tile: &Tile| {
        if let Some(kept) = &kept {
            kept.keep(tile);
        }
        if header.share.is_some() {
            own.lock().unwrap_or_else(PoisonError::into_inner).push(tile.clone());
        }
    };
    let film = renderer.render_tiles(&settings, progress, &finished);
    progress.clear();
    let mut film = film?;
    if let Some(failure) = kept.as_ref().and_then(Kept::failure) {
        terminal::report(&format!("warning: not all tiles could be kept: {failure}"));
    }
    if !film.complete {
        if let Some(kept) = &kept {
            kept.sync()?;
            let path = kept_file(target);
            let stopped = format!("stopped: finished tiles are kept in {}; the same command goes on", path.display());
            terminal::report(&stopped);
        }
        return Ok((film, kept));
    }
    found.tiles.iter().for_each(|tile| film.put(tile));
    if header.share.is_some() {
        let mut tiles = own.into_inner().unwrap_or_else(PoisonError::into_inner);
        tiles.extend(found.tiles);
        tiles.sort_by_key(|tile| tile.number);
        write_part(target, header, &tiles)?;
    }
    Ok((film, kept))
}

/// Flags of `merge`.
#[derive(Debug, Args)]
pub struct MergeArguments {
    /// The parts, in any order.
    #[arg(value_name = "PART", required = true, value_hint = ValueHint::FilePath)]
    pub parts: Vec<PathBuf>,
    /// Picture to write: .png, .jpg, .exr, .hdr and others, by suffix.
    #[arg(short, long = "output", value_name = "OUT", value_hint = ValueHint::FilePath)]
    pub output: PathBuf,
    /// Refuse to replace a file that exists.
    #[arg(long)]
    pub no_clobber: bool,
    /// Print nothing but errors.
    #[arg(long)]
    pub quiet: bool,
}

/// Makes one picture of the parts that several processes rendered.
///
/// # Errors
/// As [`crate::job::merge`], and those of writing.
pub fn merge(arguments: &MergeArguments) -> Result<()> {
    let MergeArguments { parts, output, no_clobber, quiet } = arguments;
    picture::PictureFormat::of(output)?;
    outputs::refuse_inputs(output, parts.iter().map(PathBuf::as_path))?;
    let terminal = Terminal::new(*quiet)?;
    let film = crate::job::merge(parts, &terminal);
    terminal.clear();
    let film = film?;
    let outputs = Outputs::of_picture(Picture::File(output.clone()), !film.aovs.is_empty(), *no_clobber)?;
    outputs.check()?;
    outputs.write(&film)?;
    if *quiet { Ok(()) } else { terminal::print(format!("{}\n", output.display()).as_bytes()) }
}
