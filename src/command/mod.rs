//! What each command does, from its arguments to what it prints.

mod cells;
mod check;
mod hunt;
mod inspect;
mod progress;
mod results;
mod run;
mod show;

use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::experiment::sweep::{self, Setting};

use crate::arguments::Command;

pub fn carry_out(command: Command) -> Result<(), Diagnostic> {
    match command {
        Command::Run(wanted) => run::run(wanted),
        Command::Plan { file, set } => show::plans(&file, settings(&set)?),
        Command::Cells(wanted) => cells::list(&wanted),
        Command::Report(wanted) => results::report(&wanted),
        Command::Compare(wanted) => results::compare(&wanted),
        Command::Schema => results::schema(),
        Command::Stages { name } => show::stages(name.as_deref()),
        Command::Check { stage, adapter } => check::check(stage.as_deref(), adapter.as_deref()),
        Command::Hunt(wanted) => hunt::hunt_for(wanted),
        Command::Inspect(wanted) => inspect::inspect(wanted),
        Command::Devices => show::devices(),
    }
}

/// What is set on the command line, the number of frames included.
fn set(set: &[String], frames: Option<u32>) -> Vec<String> {
    set.iter().cloned().chain(frames.map(|frames| format!("scene.camera.frames={frames}"))).collect()
}

fn settings(arguments: &[String]) -> Result<Vec<Setting>, Diagnostic> {
    let mut settings: Vec<Setting> = Vec::new();
    for argument in arguments {
        let setting = sweep::read_setting(argument)?;
        // of several for one path the last counts
        settings.retain(|known| known.path != setting.path);
        settings.push(setting);
    }
    Ok(settings)
}
