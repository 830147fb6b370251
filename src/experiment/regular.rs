//! Files that somebody names, or that lie where only files are expected. Pipes and devices are not opened: to open a pipe waits for
//! whoever writes into it, and what a device gives need not end.

use std::fs::{self, File};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Opens a regular file, or what a link to one leads to.
pub fn open(path: &Path) -> Result<File> {
    let kind = fs::metadata(path)?;
    let refuse = |what| Err(Error::new(ErrorKind::InvalidInput, what));
    if kind.is_dir() {
        return refuse("it is a folder; expected a file");
    }
    if !kind.is_file() {
        return refuse("it is a pipe or a device; expected a file, so copy what it gives into one");
    }
    File::open(path)
}

/// The bytes of a regular file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a regular file.
pub fn read_to_string(path: &Path) -> Result<String> {
    let mut text = String::new();
    open(path)?.read_to_string(&mut text)?;
    Ok(text)
}
