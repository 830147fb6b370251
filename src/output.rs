//! Standard output and standard error. Nobody may read them, and the disk behind them can be full: neither ends the program.

use std::fmt::{Arguments, Display};
use std::io::{self, ErrorKind, Write};
use std::sync::OnceLock;

use lodlab::experiment::diagnostic::Diagnostic;

/// Why a line of the results is lost.
static LOST: OnceLock<io::Error> = OnceLock::new();

/// Prints a line of what was asked for. A failure is told at the end: see [`finish`].
pub fn say(line: Arguments) {
    note(writeln!(io::stdout(), "{line}"));
}

/// Prints what went wrong. If nobody can be told, the exit status has to do.
pub fn complain(error: impl Display) {
    let _ = writeln!(io::stderr(), "{error}");
}

/// Remembers that something could not be written; a reader that went away (`| head`) has what it wanted.
pub fn note(written: io::Result<()>) {
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            LOST.get_or_init(|| error);
        }
        _ => {}
    }
}

/// Whether everything that was said has been written.
pub fn finish() -> Result<(), Diagnostic> {
    note(io::stdout().flush());
    match LOST.get() {
        None => Ok(()),
        Some(error) => Err(Diagnostic::run(format!("standard output cannot be written: {error}"))),
    }
}
