//! The files that a rendering writes: named, checked and protected before anything is rendered.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::arguments::RenderArguments;
use crate::error::{Error, Result};
use crate::formats::atomic_file::{check_writable, write_atomically};
use crate::formats::picture::{self, PictureFormat};
use crate::render::Film;

/// What stands for a frame's number in the picture's name.
const FRAME: &str = "{frame}";

/// Where the picture goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Picture {
    /// As a PNG to standard output.
    Stdout,
    /// To a file, in the format of its suffix.
    File(PathBuf),
}

impl Picture {
    /// The file, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Stdout => None,
            Self::File(path) => Some(path),
        }
    }
}

/// Every file that a rendering may write.
#[derive(Debug)]
pub struct Outputs {
    /// The picture.
    pub picture: Picture,
    /// Extra values, where the picture's own file cannot hold them.
    pub aov_file: Option<PathBuf>,
    /// What was finished of an interrupted picture.
    pub partial: Option<PathBuf>,
    /// A share of the picture's tiles, instead of the picture.
    pub part: Option<PathBuf>,
    /// The scene that was chosen for a model.
    pub scene: Option<PathBuf>,
    /// Rays, times and memory.
    pub stats: Option<PathBuf>,
    no_clobber: bool,
}

impl Outputs {
    /// Names the files and finds out what would stop them from being written.
    ///
    /// # Errors
    /// A picture whose suffix names no format; a file that is the input, that exists and must not be replaced, that is
    /// named twice, or whose folder is missing or cannot be written to.
    pub fn plan(arguments: &RenderArguments) -> Result<Self> {
        let picture = match &arguments.output {
            Some(path) if path.as_os_str() == "-" => Picture::Stdout,
            Some(path) => {
                PictureFormat::of(path)?;
                Picture::File(path.clone())
            }
            None => Picture::File(default_picture(&arguments.input, arguments.job.frame_range().is_some())?),
        };
        let is_pattern = picture.path().is_some_and(|path| path.to_string_lossy().contains(FRAME));
        if arguments.job.frame_range().is_some() != is_pattern {
            let error = Error::caller(if is_pattern {
                format!("the picture's name has {FRAME}, but there are no frames")
            } else {
                "all frames would go to one file".into()
            });
            let error = picture.path().into_iter().fold(error, Error::at_path);
            return Err(error.remedy(if is_pattern {
                "say --frames A..B, or leave it out of the name".into()
            } else {
                format!("put {FRAME} into the name, such as turn.{FRAME}.png")
            }));
        }
        if let (Picture::Stdout, true) = (&picture, arguments.job.writes_tiles()) {
            return Err(Error::caller(
                "--resume and --part write tiles beside the picture, which has no file when it is streamed",
            )
            .remedy("name a file with -o"));
        }
        let mut outputs = Self::of_picture(picture, !arguments.aov.is_empty(), arguments.no_clobber)?;
        outputs.scene = arguments.save_scene.clone();
        outputs.stats = arguments.stats_json.clone();
        outputs.part = outputs.picture.path().and_then(|path| arguments.job.part_file(path));
        if outputs.part.is_some() || arguments.job.resume {
            outputs.partial = None;
        }
        outputs.refuse_inputs([arguments.input.as_path()])?;
        outputs.check()?;
        Ok(outputs)
    }

    /// A picture, what goes beside it, and nothing else.
    ///
    /// # Errors
    /// A picture whose suffix names no format, or one that is streamed and has extra values.
    pub fn of_picture(picture: Picture, has_aovs: bool, no_clobber: bool) -> Result<Self> {
        let (aov_file, partial) = match &picture {
            Picture::File(path) => {
                let apart = has_aovs && !PictureFormat::of(path)?.has_layers();
                (apart.then(|| path.with_extension("aov.exr")), Some(path.with_extension("partial.png")))
            }
            Picture::Stdout if has_aovs => {
                return Err(Error::caller("extra values have no file to go to when the picture is streamed")
                    .remedy("name a file with -o, or leave out --aov"));
            }
            Picture::Stdout => (None, None),
        };
        Ok(Self { picture, aov_file, partial, part: None, scene: None, stats: None, no_clobber })
    }

    /// The files of one frame, whose number takes the place of `{frame}`, with four digits at least.
    ///
    /// # Errors
    /// A file that exists and must not be replaced.
    pub fn for_frame(&self, frame: i32) -> Result<Self> {
        let named = |path: &PathBuf| PathBuf::from(path.to_string_lossy().replace(FRAME, &format!("{frame:04}")));
        let outputs = Self {
            picture: match &self.picture {
                Picture::Stdout => Picture::Stdout,
                Picture::File(path) => Picture::File(named(path)),
            },
            aov_file: self.aov_file.as_ref().map(named),
            partial: self.partial.as_ref().map(named),
            part: None,
            scene: self.scene.clone(),
            stats: None,
            no_clobber: self.no_clobber,
        };
        let pictures = outputs.picture.path().into_iter().chain(outputs.aov_file.as_deref());
        pictures.into_iter().try_for_each(|path| outputs.refuse_clobber(path))?;
        Ok(outputs)
    }

    /// Writes a picture, and its extra values where they go to a file of their own.
    ///
    /// # Errors
    /// Those of writing.
    pub fn write(&self, film: &Film) -> Result<()> {
        // The picture comes last: where it is, all is.
        self.aov_file.as_deref().map_or(Ok(()), |path| picture::save(film, path))?;
        match &self.picture {
            Picture::Stdout => write_to_stdout(film),
            Picture::File(path) => picture::save(film, path),
        }
    }

    /// The file that the tiles of this process go to: the part's, or else the picture's.
    pub fn target(&self) -> Option<&Path> {
        self.part.as_deref().or(self.picture.path())
    }

    /// Refuses to write over any of the files that were read.
    ///
    /// # Errors
    /// Names the first output that is an input.
    pub fn refuse_inputs<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
        let inputs: Vec<&Path> = inputs.into_iter().collect();
        self.files().chain(self.partial.as_deref()).try_for_each(|path| refuse_inputs(path, inputs.iter().copied()))
    }

    /// The picture and what belongs to it, or the part.
    pub fn pictures(&self) -> impl Iterator<Item = &Path> {
        let files = match &self.part {
            Some(part) => [Some(part.as_path()), None],
            None => [self.picture.path(), self.aov_file.as_deref()],
        };
        files.into_iter().flatten()
    }

    /// The files that a finished rendering writes.
    fn files(&self) -> impl Iterator<Item = &Path> {
        self.pictures().chain([self.scene.as_deref(), self.stats.as_deref()].into_iter().flatten())
    }

    /// Fails if the file exists and must stay.
    ///
    /// # Errors
    /// Names the file.
    pub fn refuse_clobber(&self, path: &Path) -> Result<()> {
        refuse_clobber(path, self.no_clobber)
    }

    /// Finds out whether all of them can be written.
    ///
    /// # Errors
    /// Names the first that cannot.
    pub fn check(&self) -> Result<()> {
        let mut taken = Vec::new();
        for path in self.files() {
            self.refuse_clobber(path)?;
            check_writable(path)?;
            let identity = identity(path);
            if taken.contains(&identity) {
                return Err(Error::caller("two outputs would go to this file")
                    .at_path(path)
                    .remedy("name another file"));
            }
            taken.push(identity);
        }
        Ok(())
    }
}

/// Refuses to write over any of the files that were read.
///
/// # Errors
/// Names the output, if it is an input.
pub(super) fn refuse_inputs<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let Some(own) = identity(output) else { return Ok(()) };
    if inputs.into_iter().filter_map(identity).any(|input| input == own) {
        return Err(Error::caller("the output is made from this file, so it is not overwritten")
            .at_path(output)
            .remedy("name another file to write"));
    }
    Ok(())
}

/// Fails if the file exists and must stay.
///
/// # Errors
/// Names the file.
pub(super) fn refuse_clobber(path: &Path, no_clobber: bool) -> Result<()> {
    // What is no regular file (a device, a pipe) is written to, not replaced.
    if !no_clobber || !path.is_file() {
        return Ok(());
    }
    Err(Error::caller("the file exists and --no-clobber was given")
        .at_path(path)
        .remedy("name another file, or leave out --no-clobber"))
}

/// Unlike text, a picture that its reader cut short is a failure: it did not arrive.
fn write_to_stdout(film: &Film) -> Result<()> {
    let mut stdout = BufWriter::new(io::stdout().lock());
    picture::write_png(film, &mut stdout)?;
    stdout.flush().map_err(|error| Error::system(Path::new("standard output"), error))
}

/// Writes a text file whole or not at all.
///
/// # Errors
/// When the operating system refuses.
pub fn write_text(path: &Path, text: &str) -> Result<()> {
    write_atomically(path, |file| file.write_all(text.as_bytes()).map_err(|cause| Error::system(path, cause)))
}

/// The input's name with `.png`, in the current folder.
fn default_picture(input: &Path, is_pattern: bool) -> Result<PathBuf> {
    named_after(input, &if is_pattern { format!(".{FRAME}.png") } else { ".png".into() })
}

/// The input's name with another suffix, in the current folder.
pub(super) fn named_after(input: &Path, suffix: &str) -> Result<PathBuf> {
    let stem = input.file_stem().ok_or_else(|| {
        Error::caller("this is no file")
            .at_path(input)
            .remedy("give a scene file (.toml) or a model (.obj, .gltf, .glb)")
    })?;
    let mut name = stem.to_os_string();
    name.push(suffix);
    Ok(name.into())
}

/// One name for every way to write a path, whether the file exists or not; `None` if its folder does not.
pub(super) fn identity(path: &Path) -> Option<PathBuf> {
    let in_folder = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
    };
    fs::canonicalize(path).ok().or_else(in_folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::arguments::{Arguments, Command};
    use clap::Parser;

    fn plan(input: &Path, flags: &[&str]) -> Result<Outputs> {
        let words = ["whitted", "render", input.to_str().unwrap()].into_iter().chain(flags.iter().copied());
        match Arguments::try_parse_from(words).unwrap().command {
            Command::Render(arguments) => Outputs::plan(&arguments),
            _ => unreachable!(),
        }
    }

    /// A folder with a file `in.obj`.
    fn folder_with_input() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("in.obj");
        fs::write(&input, "v 0 0 0\n").unwrap();
        (folder, input)
    }

    #[test]
    fn files_are_named_after_the_picture() {
        let (folder, input) = folder_with_input();
        let out = folder.path().join("a.b.jpg");
        let outputs = plan(&input, &["-o", out.to_str().unwrap(), "--aov", "depth"]).unwrap();
        assert_eq!(outputs.aov_file, Some(folder.path().join("a.b.aov.exr")));
        assert_eq!(outputs.partial, Some(folder.path().join("a.b.partial.png")));
        let layered = folder.path().join("a.EXR");
        let outputs = plan(&input, &["-o", layered.to_str().unwrap(), "--aov", "depth"]).unwrap();
        assert_eq!((outputs.picture, outputs.aov_file), (Picture::File(layered), None));
        assert_eq!(default_picture(Path::new("models/duck.v2.glb"), false).unwrap(), Path::new("duck.v2.png"));
        assert!(default_picture(Path::new(".."), false).is_err());
    }

    #[test]
    fn the_input_is_recognised_by_any_of_its_names() {
        let (folder, input) = folder_with_input();
        let detour = folder.path().join(".").join("in.obj");
        for flag in ["--stats-json", "--save-scene"] {
            let error = plan(&input, &[flag, detour.to_str().unwrap()]).unwrap_err();
            assert!(error.message().contains("made from this file"), "{flag}: {error}");
        }
        #[cfg(unix)]
        {
            let link = folder.path().join("link.png");
            std::os::unix::fs::symlink(&input, &link).unwrap();
            assert!(plan(&input, &["-o", link.to_str().unwrap()]).is_err());
        }
    }

    #[test]
    fn what_cannot_be_written_is_found_out_at_once() {
        let (folder, input) = folder_with_input();
        let place = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
        let error = plan(&input, &["-o", &place("missing/out.png")]).unwrap_err();
        assert!(error.to_string().contains("create it first"), "{error}");
        let named_like_a_picture = place("folder.png");
        fs::create_dir(&named_like_a_picture).unwrap();
        assert!(plan(&input, &["-o", &named_like_a_picture]).unwrap_err().message().contains("is a folder"));
        assert!(plan(&input, &["-o", &place("out.gif")]).unwrap_err().message().contains("gif"));
        let twice = plan(&input, &["-o", &place("out.png"), "--stats-json", &place("./out.png")]);
        assert!(twice.unwrap_err().message().contains("two outputs"));
        assert!(plan(&input, &["-o", "-", "--aov", "depth"]).is_err());
    }

    #[test]
    fn existing_files_are_replaced_unless_that_is_refused() {
        let (folder, input) = folder_with_input();
        let out = folder.path().join("out.png");
        let stats = folder.path().join("stats.json");
        fs::write(&stats, "old").unwrap();
        let flags = ["-o", out.to_str().unwrap(), "--stats-json", stats.to_str().unwrap()];
        assert!(plan(&input, &flags).is_ok());
        let refused = plan(&input, &[&flags[..], &["--no-clobber"]].concat()).unwrap_err();
        assert!(refused.to_string().contains("stats.json") && refused.message().contains("exists"), "{refused}");
    }

    #[test]
    fn planning_leaves_nothing_behind() {
        let (folder, input) = folder_with_input();
        plan(&input, &["-o", folder.path().join("out.png").to_str().unwrap()]).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
