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
/// `write` fails, `path` stays as it was. What a process leaves that is killed meanwhile, the next one takes that writes the
/// same file. The file gets the permissions of any newly created file. A link is followed.
/// What is no regular file (a device, a pipe), or an open one by its number (`/dev/stdout`, `/dev/fd/3`), cannot be
/// replaced: the finished content is appended to it.
///
/// # Errors
/// Those of `write`, and the system's, with the path.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut dyn Sink) -> Result<()>) -> Result<()> {
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
    let temporary = buffered.into_inner().map_err(|failed| system(failed.into_error()))?;
    temporary.persist(&target).map_err(system)
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
    #[cfg(unix)]
    {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::File::open(folder).and_then(|folder| folder.sync_all()).map_err(system)?;
    }
    Ok(())
}

/// Whether a path leads to what this process has open already, by its number.
fn is_descriptor(path: &Path) -> bool {
    /// Links that are followed; more are a circle.
    const MOST_LINKS: usize = 40;
    let Ok(descriptors) = fs::canonicalize("/dev/fd") else { return false };
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
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
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let temporary = Temporary::create(folder, &target).map_err(|cause| match cause.kind() {
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
    /// One whose name says what it is for, held by a lock.
    Named(named::Held),
    /// One of any name, where there are no such, or another process holds it.
    Any(tempfile::NamedTempFile),
}

impl Temporary {
    fn create(folder: &Path, target: &Path) -> io::Result<Self> {
        if let Some(held) = named::Held::take(folder, target) {
            return Ok(Self::Named(held));
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".whitted-").suffix(".tmp");
        // The permissions that the umask leaves of a normal file's, not the owner's alone.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        builder.tempfile_in(folder).map(Self::Any)
    }

    /// Takes the place of a file.
    fn persist(self, target: &Path) -> io::Result<()> {
        match self {
            Self::Named(held) => held.persist(target),
            Self::Any(file) => file.persist(target).map(drop).map_err(|failed| failed.error),
        }
    }

    fn file(&mut self) -> &mut fs::File {
        match self {
            Self::Named(held) => held.file(),
            Self::Any(file) => file.as_file_mut(),
        }
    }
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

/// Temporary files that the next process finds by their names, should one be killed.
mod named {
    use std::fs::{File, OpenOptions};
    use std::io;
    use std::path::{Path, PathBuf};

    /// A temporary file that no other process has.
    #[derive(Debug)]
    pub struct Held {
        file: File,
        /// `None` once it took its place.
        path: Option<PathBuf>,
    }

    impl Held {
        /// Takes the file for a target, new or left by a process that was killed. `None` where another one holds it, or it is not
        /// a file that this process may write to.
        #[cfg(target_os = "linux")]
        pub fn take(folder: &Path, target: &Path) -> Option<Self> {
            use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
            let mut name = std::ffi::OsString::from(".whitted-");
            name.push(target.file_name()?);
            name.push(".tmp");
            let path = folder.join(name);
            // A link that someone else has put there is not followed.
            let mut options = OpenOptions::new();
            options.read(true).write(true).create(true).truncate(false).custom_flags(libc::O_NOFOLLOW);
            let file = options.open(&path).ok()?;
            file.try_lock().ok()?;
            // Another process may have given it its place, or deleted it, before it was locked.
            let (own, there) = (file.metadata().ok()?, std::fs::symlink_metadata(&path).ok()?);
            let is_there = (own.dev(), own.ino()) == (there.dev(), there.ino());
            if !(is_there && own.is_file() && own.nlink() == 1) {
                return None;
            }
            // The file is ours alone from here on, and goes away with this.
            let held = Self { file, path: Some(path) };
            held.file.set_len(0).ok()?;
            Some(held)
        }

        /// Elsewhere open files cannot take another's place.
        #[cfg(not(target_os = "linux"))]
        pub fn take(_: &Path, _: &Path) -> Option<Self> {
            None
        }

        /// Takes the place of a file.
        pub fn persist(mut self, target: &Path) -> io::Result<()> {
            let path = self.path.take().expect("it takes its place once");
            std::fs::rename(&path, target).inspect_err(|_| drop(std::fs::remove_file(&path)))
        }

        pub fn file(&mut self) -> &mut File {
            &mut self.file
        }
    }

    impl Drop for Held {
        fn drop(&mut self) {
            if let Some(path) = self.path.take() {
                let _ = std::fs::remove_file(path);
            }
        }
    }
}

/// The cause of a failed operation on a temporary file, without that file's name.
fn plain(cause: &std::io::Error) -> String {
    cause
        .raw_os_error()
        .map_or_else(|| cause.kind().to_string(), |code| std::io::Error::from_raw_os_error(code).to_string())
}

/// `path` as seen from the folder of `file`, where that is possible; separators are `/`.
pub fn relative_to(path: &Path, file: &Path) -> PathBuf {
    let absolute = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (Ok(path_there), Ok(folder)) = (absolute(path), absolute(folder)) else { return path.to_path_buf() };
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
    fn what_a_killed_process_left_is_taken_and_what_another_holds_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let left = folder.path().join(".whitted-a.txt.tmp");
        let write = || {
            write_atomically(&path, |sink| sink.write_all(b"new").map_err(|cause| Error::system(Path::new("x"), cause)))
        };
        let names = || {
            let mut names: Vec<_> =
                fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        fs::write(&left, "longer than what is new").unwrap();
        write().unwrap();
        assert_eq!((fs::read_to_string(&path).unwrap().as_str(), names()), ("new", vec!["a.txt".into()]));
        fs::write(&left, "").unwrap();
        check_writable(&path).unwrap();
        assert_eq!(names(), ["a.txt"]);
        // Another process has it.
        let other = fs::File::create(&left).unwrap();
        other.lock().unwrap();
        write().unwrap();
        assert_eq!(names(), [".whitted-a.txt.tmp", "a.txt"]);
        drop(other);
        // Links lead elsewhere.
        fs::remove_file(&left).unwrap();
        fs::write(folder.path().join("b"), "other").unwrap();
        std::os::unix::fs::symlink("b", &left).unwrap();
        write().unwrap();
        fs::remove_file(&left).unwrap();
        fs::hard_link(folder.path().join("b"), &left).unwrap();
        write().unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("b")).unwrap(), "other");
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
