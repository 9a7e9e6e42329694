//! Files that are either written whole or not touched.

use std::fs;
use std::io::{self, BufWriter, Cursor, Seek, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Fault, Result};

/// What a file's content is written to.
pub trait Sink: Write + Seek {}
impl<T: Write + Seek> Sink for T {}

/// Writes a file by `write` such that a reader never sees a part of it.
///
/// The content goes to a temporary file in the same folder, which takes the place of `path` once all is there; if
/// `write` fails, `path` stays as it was. Where the system has files without names, as Linux has on most file systems, nothing
/// is left by a process that is killed meanwhile. The file gets the permissions of any newly created file. A link is followed.
/// What is no regular file (a device, a pipe), or an open one by its number (`/dev/stdout`, `/dev/fd/3`), cannot be
/// replaced: the finished content is appended to it.
///
/// # Errors
/// Those of `write`, and the system's, with the path.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut dyn Sink) -> Result<()>) -> Result<()> {
    write_whole(path, false, write)
}

/// [`write_atomically`], with the content brought to the disk before it takes the old one's place, and its name afterwards: also after a
/// power cut there is the old file or the new one.
///
/// # Errors
/// As `write_atomically`.
pub fn write_durably(path: &Path, write: impl FnOnce(&mut dyn Sink) -> Result<()>) -> Result<()> {
    write_whole(path, true, write)
}

fn write_whole(path: &Path, durably: bool, write: impl FnOnce(&mut dyn Sink) -> Result<()>) -> Result<()> {
    let system = |cause| Error::system(path, cause);
    match fs::metadata(path) {
        Ok(existing) if existing.is_dir() => return Err(is_a_folder(path)),
        Ok(existing) if !existing.is_file() || is_descriptor(path) => {
            let mut content = Cursor::new(Vec::new());
            write(&mut content).map_err(|error| error.at_path(path))?;
            return fs::OpenOptions::new()
                .append(true)
                .open(path)
                .and_then(|mut file| file.write_all(content.get_ref()))
                .map_err(system);
        }
        _ => {}
    }
    let (target, temporary) = temporary_for(path)?;
    let mut buffered = BufWriter::new(temporary);
    write(&mut buffered).map_err(|error| error.at_path(path))?;
    let mut temporary = buffered.into_inner().map_err(|failed| system(failed.into_error()))?;
    if durably {
        temporary.file().sync_all().map_err(system)?;
    }
    temporary.persist(&target).map_err(system)?;
    if durably { sync_folder(&target) } else { Ok(()) }
}

/// Finds out whether [`write_atomically`] could write a file, without touching it.
///
/// # Errors
/// A folder that is missing or cannot be written to, or that `path` is itself.
pub fn check_writable(path: &Path) -> Result<()> {
    match fs::metadata(path) {
        Ok(existing) if existing.is_dir() => Err(is_a_folder(path)),
        Ok(existing) if !existing.is_file() || is_descriptor(path) => Ok(()),
        _ => temporary_for(path).map(drop),
    }
}

/// Brings a file that was written, and its name, to the disk.
///
/// # Errors
/// The system's.
pub fn sync(path: &Path) -> Result<()> {
    let system = |cause| Error::system(path, cause);
    fs::File::open(path).and_then(|file| file.sync_all()).map_err(system)?;
    sync_folder(path)
}

/// Brings the names in a file's folder to the disk.
#[cfg(unix)]
fn sync_folder(path: &Path) -> Result<()> {
    let synced = fs::File::open(folder_of(path)).and_then(|folder| folder.sync_all());
    synced.map_err(|cause| Error::system(path, cause))
}

/// Elsewhere folders cannot be opened.
#[cfg(not(unix))]
fn sync_folder(_: &Path) -> Result<()> {
    Ok(())
}

/// The folder that a file is in, as its path says.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether a path leads to what this process has open already, by its number.
fn is_descriptor(path: &Path) -> bool {
    /// Links that are followed; more are a circle.
    const MOST_LINKS: usize = 40;
    let Ok(descriptors) = fs::canonicalize("/dev/fd") else { return false };
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let folder = folder_of(&path);
        if fs::canonicalize(folder).is_ok_and(|folder| folder == descriptors) {
            return true;
        }
        let Ok(target) = fs::read_link(&path) else { return false };
        path = folder.join(target);
    }
    false
}

fn is_a_folder(path: &Path) -> Error {
    Error::caller("is a folder").at_path(path).remedy("give the name of a file in it")
}

/// Where a file really is, links followed, and a temporary file in the same folder.
fn temporary_for(path: &Path) -> Result<(PathBuf, Temporary)> {
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = folder_of(&target);
    let temporary = Temporary::create(folder).map_err(|cause| match cause.kind() {
        io::ErrorKind::NotFound => {
            Error::caller(format!("there is no folder `{}`", folder.display())).at_path(path).remedy("create it first")
        }
        _ => Error::new(Fault::System, format!("cannot create a file in `{}`: {}", folder.display(), plain(&cause)))
            .at_path(path),
    })?;
    Ok((target, temporary))
}

/// A file that goes away unless it takes another's place.
#[derive(Debug)]
enum Temporary {
    /// One without a name, which goes away with the process, however that ends; and the folder that it is in.
    #[cfg(target_os = "linux")]
    Nameless(fs::File, PathBuf),
    /// One of any name.
    Named(tempfile::NamedTempFile),
}

impl Temporary {
    fn create(folder: &Path) -> io::Result<Self> {
        #[cfg(target_os = "linux")]
        if let Some(file) = nameless(folder) {
            return Ok(Self::Nameless(file, folder.to_path_buf()));
        }
        Self::builder().tempfile_in(folder).map(Self::Named)
    }

    fn builder() -> tempfile::Builder<'static, 'static> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".whitted-").suffix(".tmp");
        // The permissions that the umask leaves of a normal file's, not the owner's alone.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        builder
    }

    /// Takes the place of a file.
    fn persist(self, target: &Path) -> io::Result<()> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Nameless(mut file, folder) => {
                // A name that nothing has, for the moment until it gets its own.
                if let Ok(named) = Self::builder().make_in(&folder, |path| give_name(&file, path)) {
                    return named.persist(target).map(drop).map_err(|failed| failed.error);
                }
                // Some systems refuse names to what had none.
                let mut named = Self::builder().tempfile_in(folder)?;
                file.rewind()?;
                io::copy(&mut file, &mut named)?;
                named.as_file().sync_all()?;
                named.persist(target).map(drop).map_err(|failed| failed.error)
            }
            Self::Named(file) => file.persist(target).map(drop).map_err(|failed| failed.error),
        }
    }

    fn file(&mut self) -> &mut fs::File {
        match self {
            #[cfg(target_os = "linux")]
            Self::Nameless(file, _) => file,
            Self::Named(file) => file.as_file_mut(),
        }
    }
}

/// A file without a name in a folder; `None` where the file system has no such, or they could not be given one.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<fs::File> {
    use std::os::unix::fs::OpenOptionsExt;
    let file = fs::OpenOptions::new().read(true).write(true).custom_flags(libc::O_TMPFILE).open(folder).ok()?;
    fs::symlink_metadata(way_to(&file)).is_ok().then_some(file)
}

/// Where the system shows an open file.
#[cfg(target_os = "linux")]
fn way_to(file: &fs::File) -> PathBuf {
    use std::os::fd::AsRawFd;
    format!("/proc/self/fd/{}", file.as_raw_fd()).into()
}

#[cfg(target_os = "linux")]
fn give_name(file: &fs::File, path: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, way_to(file), CWD, path, AtFlags::SYMLINK_FOLLOW)?)
}

impl Write for Temporary {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file().flush()
    }
}

impl Seek for Temporary {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.file().seek(to)
    }
}

/// The cause of a failed operation on a temporary file, without that file's name.
fn plain(cause: &std::io::Error) -> String {
    cause
        .raw_os_error()
        .map_or_else(|| cause.kind().to_string(), |code| std::io::Error::from_raw_os_error(code).to_string())
}

/// `path` as seen from the folder of `file`, where that is possible; separators are `/`. Of links, folders are followed and the file
/// itself is not.
pub fn relative_to(path: &Path, file: &Path) -> PathBuf {
    let absolute = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    let with_name = |folder: PathBuf| path.file_name().map(|name| folder.join(name));
    let Some(path_there) = absolute(folder_of(path)).ok().and_then(with_name) else { return path.to_path_buf() };
    let Ok(folder) = absolute(folder_of(file)) else { return path.to_path_buf() };
    let shared = path_there.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    // Different drives have no way between them.
    if shared == 0 {
        return path_there;
    }
    let up = folder.components().skip(shared).map(|_| "..".as_ref());
    up.chain(path_there.components().skip(shared).map(|part| part.as_os_str())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_leaves_the_file_as_it_was_and_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let failed = write_atomically(&path, |sink| {
            sink.write_all(b"new").unwrap();
            Err(Error::caller("no"))
        });
        assert_eq!(failed.unwrap_err().path(), Some(path.as_path()));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        write_atomically(&path, |sink| sink.write_all(b"new").map_err(|cause| Error::system(Path::new("x"), cause)))
            .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn nothing_has_a_name_before_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let names = || fs::read_dir(folder.path()).unwrap().count();
        if nameless(folder.path()).is_none() {
            return eprintln!("skipped: this file system has no files without names");
        }
        let path = folder.path().join("a.txt");
        for (content, before) in [("first", 0), ("second", 1)] {
            let write = |sink: &mut dyn Sink| {
                sink.write_all(content.as_bytes()).unwrap();
                assert_eq!(names(), before);
                Ok(())
            };
            if before == 0 { write_atomically(&path, write) } else { write_durably(&path, write) }.unwrap();
            assert_eq!((fs::read_to_string(&path).unwrap().as_str(), names()), (content, 1));
        }
        check_writable(&path).unwrap();
        assert_eq!(names(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_any_new_file_and_links_are_followed() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        fs::write(folder.path().join("plain"), "").unwrap();
        write_atomically(&folder.path().join("ours"), |_| Ok(())).unwrap();
        assert_eq!(mode("ours"), mode("plain"));
        std::os::unix::fs::symlink("plain", folder.path().join("link")).unwrap();
        write_atomically(&folder.path().join("link"), |sink| {
            sink.write_all(b"through").unwrap();
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("plain")).unwrap(), "through");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_open_already_is_not_replaced() {
        use std::os::fd::AsRawFd;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        fs::write(&path, "before\n").unwrap();
        let open = fs::OpenOptions::new().append(true).open(&path).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(format!("/dev/fd/{}", open.as_raw_fd()), &link).unwrap();
        check_writable(&link).unwrap();
        write_atomically(&link, |sink| sink.write_all(b"new").map_err(|cause| Error::system(Path::new("x"), cause)))
            .unwrap();
        (&open).write_all(b" and after").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "before\nnew and after");
        assert!(!is_descriptor(&path) && is_descriptor(Path::new("/dev/stdout")));
    }

    #[test]
    fn folders_are_refused_and_missing_ones_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write_atomically(folder.path(), |_| Ok(())).unwrap_err().to_string().contains("is a folder"));
        let missing = folder.path().join("no/a.png");
        let message = write_atomically(&missing, |_| Ok(())).unwrap_err().to_string();
        assert!(message.contains("there is no folder") && message.contains("create it first"), "{message}");
    }

    #[test]
    fn relative_paths_lead_from_the_file_to_the_other() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a/b", "c"] {
            fs::create_dir_all(folder.path().join(name)).unwrap();
        }
        let model = folder.path().join("c/model.obj");
        fs::write(&model, "").unwrap();
        let file = folder.path().join("a/b/scene.toml");
        assert_eq!(relative_to(&model, &file), Path::new("../../c/model.obj"));
        assert_eq!(relative_to(&model, &folder.path().join("c/scene.toml")), Path::new("model.obj"));
    }
}
