//! What a run says while it goes on: a line of progress on a terminal, a line a cell elsewhere, or events for programs.

use std::collections::{BTreeMap, BTreeSet};
use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use lodlab::report::table::digits;
use lodlab::run::Event;

/// How a run is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manner {
    /// For somebody who watches.
    Lines,
    /// Warnings alone.
    Quiet,
    /// One JSON object a line.
    Json,
}

/// A bar with the time left on a terminal; elsewhere nothing.
pub fn bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} cells, {rate} a second, {eta} left: {msg}");
    let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        // a bar that cannot be written is no reason to stop
        let _ = write!(out, "{}", digits(state.per_sec()));
    };
    let style = style.unwrap_or_else(|_| ProgressStyle::default_bar()).with_key("rate", rate);
    ProgressBar::new(0).with_style(style)
}

pub struct Progress {
    manner: Manner,
    bar: ProgressBar,
    /// Warnings that were told.
    told: BTreeSet<String>,
    cells: usize,
    done: usize,
    /// Label and chain of the cell that runs.
    running: (String, String),
    /// The least error of each chain so far, in pixels.
    best_px: BTreeMap<String, f64>,
}

impl Progress {
    pub fn new(manner: Manner) -> Self {
        let bar = if manner == Manner::Lines { bar() } else { ProgressBar::hidden() };
        let (told, best_px) = Default::default();
        Self { manner, bar, told, cells: 0, done: 0, running: Default::default(), best_px }
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn line(&self, text: &str) {
        match self.bar.is_hidden() {
            true => say!("{text}"),
            false => self.bar.println(text),
        }
    }

    /// The same, where somebody wants to know it and no bar shows it.
    fn note(&self, text: &str) {
        if self.manner == Manner::Lines && self.bar.is_hidden() {
            self.line(text);
        }
    }

    fn is_over(&mut self) {
        self.done += 1;
        self.bar.set_position(self.done as u64);
    }

    /// Shows an event; a warning that was told before is not told again.
    pub fn show(&mut self, event: &Event) {
        if self.manner == Manner::Json {
            if let Ok(line) = serde_json::to_string(event) {
                say!("{line}");
            }
            return;
        }
        match event {
            Event::Planned { cells, of } => {
                self.bar.set_length(*of as u64);
                self.bar.set_message(format!("planning cell {} of {of}", cells + 1));
            }
            Event::Started { cells, finished } => {
                (self.cells, self.done) = (*cells, *finished);
                self.bar.set_length(*cells as u64);
                self.bar.reset();
                self.bar.set_position(*finished as u64);
                if *finished > 0 {
                    self.note(&format!("{finished} of {cells} cells are finished and stay as they are"));
                }
            }
            Event::CellStarted { label, chain, reason } => {
                self.running = (label.clone(), chain.clone());
                self.bar.set_message(label.clone());
                let line = format!("run {label} ({reason})");
                // why a cell runs again is worth a line anywhere
                match reason.as_str() {
                    "new" => self.note(&line),
                    _ if self.manner == Manner::Lines => self.line(&line),
                    _ => {}
                }
            }
            Event::Frame { done, of } => {
                let (label, chain) = &self.running;
                let best = self.best_px.get(chain);
                let best = best.map_or(String::new(), |px| format!(", best so far {} px", digits(*px)));
                self.bar.set_message(format!("{label}, frame {done} of {of}{best}"));
            }
            Event::CellDone { label, chain, frame_ms, error_rms_px } => {
                self.is_over();
                if let Some(px) = error_rms_px {
                    let best = self.best_px.entry(chain.clone()).or_insert(f64::INFINITY);
                    *best = best.min(*px);
                }
                let time = frame_ms.map_or("not timed".into(), |ms| format!("{} ms a frame", digits(ms)));
                let error = error_rms_px.map_or(String::new(), |px| format!(", {} px rms", digits(px)));
                self.note(&format!("[{}/{}] {label}: {time}{error}", self.done, self.cells));
            }
            Event::CellFailed { label, why, does_not_fit } => {
                self.is_over();
                let what = if *does_not_fit { "skip" } else { "FAIL" };
                let fits = if *does_not_fit { "it does not fit: " } else { "" };
                self.line(&format!("{what} {label} ({fits}{why})"));
            }
            Event::CellIsDone { label } => {
                self.is_over();
                self.note(&format!("skip {label} (another process has run it)"));
            }
            Event::CellIsTheSame { label } => {
                self.is_over();
                self.note(&format!("skip {label} (another cell computes the same)"));
            }
            Event::Note { text } => self.note(&format!("  {text}")),
            Event::Warning { text } => {
                if self.told.insert(text.clone()) {
                    self.line(&format!("  warning: {text}"));
                }
            }
        }
    }
}
