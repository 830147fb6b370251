//! The folder that a run leaves its results in: a file for each cell, written whole or not at all. Other runs may write into it at the same
//! time, also from other machines: there are no locks, and no file but these says what is finished.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::records::{FORMAT, Failure, Head, Identity, Made, Name, Record};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::regular;
use crate::experiment::sweep::Varied;

/// The folder a run leaves its results in.
pub struct Store {
    pub folder: PathBuf,
    earlier: BTreeMap<String, Record>,
    failures: Vec<Failure>,
    /// Files in the place of records that are not taken for one, and why.
    pub refused: Vec<(PathBuf, &'static str)>,
    /// Names of the files that were written and have to be there in the end.
    written: RefCell<BTreeSet<String>>,
    /// A file could not be written: that is no fault of the cell that it belongs to.
    is_full: Cell<bool>,
}

/// Letters of the digest that a record's file begins with.
const DIGEST_LENGTH: usize = 32;

fn digest(rest: &str) -> String {
    blake3::hash(rest.as_bytes()).to_hex().as_str()[..DIGEST_LENGTH].to_string()
}

/// The text of a cell's file: its first field is the digest of all that follows, so that what somebody changes later is seen.
fn seal(cell: &impl Serialize) -> Result<String, serde_json::Error> {
    let text = serde_json::to_string(cell)?;
    let rest = text.strip_prefix('{').unwrap_or(&text);
    Ok(format!("{SEAL_START}{}{SEAL_END}{rest}", digest(rest)))
}

const SEAL_START: &str = "{\"digest\":\"";
const SEAL_END: &str = "\",";

/// What a file says of a cell, if it is what was written under this name.
fn unseal<T: DeserializeOwned>(path: &Path, head: impl Fn(&T) -> &Head) -> Result<T, &'static str> {
    let no_record = "is no record of this version";
    let text = regular::read_to_string(path).map_err(|_| "cannot be read as a file")?;
    let cell: T = serde_json::from_str(&text).map_err(|_| {
        let format = serde_json::from_str::<serde_json::Value>(&text).ok();
        match format.and_then(|value| value["identity"]["format"].as_u64()) {
            Some(format) if format != u64::from(FORMAT) => OTHER_VERSION,
            _ => no_record,
        }
    })?;
    let sealed =
        text.strip_prefix(SEAL_START).and_then(|text| text.split_at_checked(DIGEST_LENGTH)).ok_or(no_record)?;
    let rest = sealed.1.strip_prefix(SEAL_END).ok_or(no_record)?;
    let Head { hash, identity, .. } = head(&cell);
    let is_its_own = path.file_stem().is_some_and(|stem| stem == hash.as_str());
    if digest(rest) != sealed.0 || !is_its_own || identity.hash() != *hash {
        return Err("is not what was written there");
    }
    Ok(cell)
}

/// Why a record with another format is left out of reports.
pub const OTHER_VERSION: &str = "is a record of another version of lodlab, with another format";

fn unseal_record(path: &Path) -> Result<Record, &'static str> {
    unseal(path, |record: &Record| &record.head)
}

/// The files of a folder whose names end as those of cells do; none if there is no such folder.
fn cell_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|kind| kind == "json")).collect();
    files.sort();
    files
}

impl Store {
    pub fn open(folder: &Path) -> Result<Self, Diagnostic> {
        let cells = folder.join("cells");
        fs::create_dir_all(&cells).map_err(|error| cannot_write(folder, &error))?;
        // found out now, not after the first cell's minutes
        tempfile::NamedTempFile::new_in(&cells).map_err(|error| cannot_write(folder, &error))?;
        Self::look(folder)
    }

    /// The results that are there, to be looked at.
    pub fn look(folder: &Path) -> Result<Self, Diagnostic> {
        let cells = folder.join("cells");
        fs::read_dir(&cells)
            .map_err(|error| Diagnostic::input(format!("`{}` is no folder of results: {error}", folder.display())))?;
        let (mut earlier, mut refused) = (BTreeMap::new(), Vec::new());
        for path in cell_files(&cells) {
            match unseal_record(&path) {
                Ok(record) => {
                    earlier.insert(record.head.hash.clone(), record);
                }
                // it is not a finished cell: it is run again and written anew
                Err(why) => refused.push((path, why)),
            }
        }
        let mut failures = Vec::new();
        for path in cell_files(&folder.join("failures")) {
            match unseal(&path, |failure: &Failure| &failure.head) {
                Ok(failure) => failures.push(failure),
                Err(why) => refused.push((path, why)),
            }
        }
        Ok(Self {
            folder: folder.to_path_buf(),
            earlier,
            failures,
            refused,
            written: RefCell::default(),
            is_full: Cell::new(false),
        })
    }

    /// All records, chain by chain.
    pub fn all(&self) -> Vec<&Record> {
        let mut all: Vec<&Record> = self.earlier.values().collect();
        all.sort_by_key(|record| (record.head.chain.clone(), record.head.settings.clone()));
        all
    }

    /// The cells that were tried and have no record.
    pub fn failures(&self) -> Vec<Failure> {
        let is_unfinished = |failure: &&Failure| !self.earlier.contains_key(&failure.head.hash);
        self.failures.iter().filter(is_unfinished).cloned().collect()
    }

    pub fn finished(&self, hash: &str) -> Option<&Record> {
        self.earlier.get(hash)
    }

    /// Why a cell that is not finished has to run.
    pub fn reason(&self, chain: &str, settings: &[Varied], identity: &Identity) -> String {
        let is_same_point = |head: &&Head| head.chain == chain && head.settings == settings;
        let same = self.earlier.values().map(|record| &record.head).filter(is_same_point);
        let closest = same.map(|head| identity.changes(&head.identity)).min_by_key(Vec::len);
        match closest {
            None => "new".into(),
            Some(changes) if changes.is_empty() => "forced".into(),
            Some(changes) => format!("changed: {}", changes.join(", ")),
        }
    }

    /// The record of a cell as it is on disk now; `None` if the cell is not finished.
    pub fn read(&self, hash: &str) -> Option<Record> {
        unseal_record(&self.folder.join(cell_name(hash))).ok()
    }

    /// Looks whether all that was written is there, and the records of these cells, of which some were finished before.
    pub fn check_complete(&self, cells: impl Iterator<Item = String>) -> Result<(), Diagnostic> {
        let mut names = self.written.borrow().clone();
        let lost = cells.filter(|hash| self.read(hash).is_none()).map(|hash| cell_name(&hash));
        let lost: BTreeSet<String> = lost.collect();
        let is_missing = |name: &&str| lost.contains(*name) || !self.folder.join(name).is_file();
        names.extend(lost.iter().cloned());
        let missing: Vec<&str> = names.iter().map(String::as_str).filter(is_missing).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let shown = missing.iter().take(MOST_NAMED).copied().collect::<Vec<_>>().join(", ");
        let more = missing.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        Err(Diagnostic::run(format!(
            "{} files of this run are gone from `{}` or were changed: {shown}{more}",
            missing.len(),
            self.folder.display()
        ))
        .help("something moved them while it ran: run it again, with --force if pictures are among them"))
    }

    pub fn save(&self, record: &Record) -> Result<(), Diagnostic> {
        let hash = &record.head.hash;
        let text = seal(record).map_err(|error| Diagnostic::run(format!("a record cannot be written: {error}")))?;
        self.write(&cell_name(hash), text.as_bytes())?;
        self.remove(&failure_name(hash));
        Ok(())
    }

    /// Notes that this process runs a cell. It is a hint to others that look for work, and no lock: whoever runs the cell anyway does no harm.
    pub fn claim(&self, hash: &str) -> Result<(), Diagnostic> {
        write_file(&self.folder, &claim_name(hash), std::process::id().to_string().as_bytes())
    }

    pub fn give_up_claim(&self, hash: &str) {
        let _ = fs::remove_file(self.folder.join(claim_name(hash)));
    }

    /// Whether another process has said a short while ago that it runs a cell.
    pub fn is_claimed(&self, hash: &str) -> bool {
        let about = fs::metadata(self.folder.join(claim_name(hash)));
        let age = about.and_then(|about| about.modified()).map(|time| time.elapsed().unwrap_or_default());
        age.is_ok_and(|age| age < CLAIM_LASTS)
    }

    /// Notes that a cell has the record of another one, which computes the same.
    pub fn save_name(&self, name: &Name) -> Result<(), Diagnostic> {
        let text = serde_json::to_string_pretty(name)
            .map_err(|error| Diagnostic::run(format!("a name cannot be written: {error}")))?;
        let key = format!("{} {} {:?} {}", name.experiment, name.chain, name.settings, name.hash);
        self.write(&format!("names/{}.json", &digest(&key)[..16]), text.as_bytes())
    }

    /// The records under each of their names.
    pub fn named(&self) -> impl Iterator<Item = Record> {
        let texts = cell_files(&self.folder.join("names")).into_iter().filter_map(|path| regular::read(&path).ok());
        let names: Vec<Name> = texts.filter_map(|text| serde_json::from_slice(&text).ok()).collect();
        let also = names.into_iter().filter_map(|Name { hash, experiment, chain, settings, date }| {
            let record = self.earlier.get(&hash)?.clone();
            let made = Made { date, ..record.head.made };
            Some(Record { head: Head { experiment, chain, settings, made, ..record.head }, ..record })
        });
        self.earlier.values().cloned().collect::<Vec<_>>().into_iter().chain(also.collect::<Vec<_>>())
    }

    /// Notes why a cell has no record.
    pub fn save_failure(&self, failure: &Failure) -> Result<(), Diagnostic> {
        let text = seal(failure).map_err(|error| Diagnostic::run(format!("a record cannot be written: {error}")))?;
        self.write(&failure_name(&failure.head.hash), text.as_bytes())
    }

    /// A file that was written need not be there in the end: another process may know better.
    pub fn forget(&self, name: &str) {
        self.written.borrow_mut().remove(name);
    }

    /// Whether a file could not be written.
    pub fn is_full(&self) -> bool {
        self.is_full.get()
    }

    /// Removes a file of an earlier run that would not be true any more.
    pub fn remove(&self, name: &str) {
        self.written.borrow_mut().remove(name);
        // most often it is not there
        let _ = fs::remove_file(self.folder.join(name));
    }

    /// Writes a file under the folder in one step: it is there whole or not at all.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Diagnostic> {
        write_file(&self.folder, name, bytes).inspect_err(|_| self.is_full.set(true))?;
        self.written.borrow_mut().insert(name.to_string());
        Ok(())
    }
}

/// Writes a file under a folder in one step: it is there whole or not at all.
pub fn write_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Diagnostic> {
    let path = folder.join(name);
    let folder = path.parent().unwrap_or(folder);
    let written = fs::create_dir_all(folder).and_then(|()| shared_file(folder)).and_then(|mut file| {
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        file.persist(&path).map_err(|error| error.error)
    });
    written.map(|_| ()).map_err(|error| cannot_write(&path, &error))
}

/// Missing files that a message names.
const MOST_NAMED: usize = 5;

fn cell_name(hash: &str) -> String {
    format!("cells/{hash}.json")
}

fn claim_name(hash: &str) -> String {
    format!("claims/{hash}")
}

/// How long a claim is believed: whoever made it may have died.
const CLAIM_LASTS: Duration = Duration::from_secs(600);

fn failure_name(hash: &str) -> String {
    format!("failures/{hash}.json")
}

/// A temporary file that, once it has its name, others can read as they can any other file.
fn shared_file(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Diagnostic {
    Diagnostic::run(format!("cannot write `{}`: {error}", path.display())).help("choose another folder with --out")
}
