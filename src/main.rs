//! The command line; what it prints goes through `output`.

/// Prints a line to standard output.
macro_rules! say {
    ($($what:tt)*) => { crate::output::say(format_args!($($what)*)) };
}

mod arguments;
mod command;
mod output;
mod threads;

use std::process::ExitCode;

use clap::Parser;

use lodlab::experiment::diagnostic::Diagnostic;

use arguments::Cli;

/// Without a display, Mesa's layer for choosing a device asks Wayland for one and complains in front of a user's first table.
fn quiet_driver() {
    let has_display = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    if !has_display && std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: this is the first thing that the program does, and there is no other thread yet.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}

fn main() -> ExitCode {
    quiet_driver();
    let command = match Cli::try_parse() {
        Ok(Cli { command }) => command,
        Err(message) => return show_message(&message),
    };
    let result = threads::start().and_then(|()| command::carry_out(command)).and_then(|()| output::finish());
    status(result)
}

/// Tells what went wrong, if something did, and says so to the shell.
fn status(result: Result<(), Diagnostic>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(diagnostic) => {
            output::complain(&diagnostic);
            ExitCode::from(diagnostic.exit_code())
        }
    }
}

/// A mistake on the command line, or the help that was asked for.
fn show_message(message: &clap::Error) -> ExitCode {
    let written = message.print();
    if message.use_stderr() {
        return ExitCode::from(2);
    }
    output::note(written);
    status(output::finish())
}
