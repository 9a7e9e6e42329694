//! What the program was built from.

use std::fs;
use std::process::Command;

/// The commit of the checkout that the program stands in, with `-dirty` where files differ from it now; it was built from
/// that unless the checkout has changed since. `None` where the program is not in a checkout's folder of build products,
/// or git is not there.
pub fn commit() -> Option<String> {
    let program = std::env::current_exe().ok()?;
    let root = program.ancestors().skip(1).find(|folder| folder.join("Cargo.toml").is_file())?;
    let manifest = fs::read_to_string(root.join("Cargo.toml")).ok()?;
    if !manifest.lines().any(|line| line.trim() == concat!("name = \"", env!("CARGO_PKG_NAME"), "\"")) {
        return None;
    }
    let output = Command::new("git")
        .arg("-C")
        .arg(root)
        .args(["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"])
        .output()
        .ok()?;
    let name = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !name.trim().is_empty()).then(|| name.trim().to_owned())
}
