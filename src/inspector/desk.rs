//! What all panes share: what is shown, what was pointed at, and what somebody asks for.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::ask::Ask;
use super::probe::{Probed, Where};
use super::screen::Screen;
use super::view::Of;
use super::wish::{Answer, CellName, Moment, Shown, Side};
use super::worker::Worker;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Gpu;

/// What a pane wants to happen. The window does it when all panes are drawn.
#[derive(Clone, Debug)]
pub enum Action {
    /// A new view, or the one that is there in its place.
    See {
        side: Side,
        of: Of,
        in_new: bool,
    },
    Close(u64),
    Set {
        side: Side,
        path: String,
        value: String,
    },
    Reset {
        side: Side,
        path: Option<String>,
    },
    Choose {
        side: Side,
        cell: CellName,
    },
    Move(Moment),
    OnCpu {
        stage: String,
        on: bool,
    },
    Open(PathBuf),
    SaveAs(PathBuf),
    OpenResults(PathBuf),
    /// What stands below, until something else does.
    Say(Result<String, Diagnostic>),
    InF64(bool),
    Truth(bool),
    Source(String),
}

/// What panes see of each other.
pub struct Desk {
    pub gpu: Arc<Gpu>,
    pub screen: Screen,
    pub worker: Worker,
    pub shown: [Option<Arc<Shown>>; 2],
    /// Where the hand points, in which view.
    pub pointer: Option<(u64, Where)>,
    pub probed: Option<Probed>,
    pub pins: Vec<Probed>,
    pub actions: Vec<Action>,
    /// Answers that nobody has taken yet.
    answers: BTreeMap<u64, Answer>,
    pub compares: bool,
    pub in_f64: bool,
    pub truth: bool,
    /// Stages that are computed on the CPU.
    pub on_cpu: Vec<String>,
}

impl Desk {
    pub fn new(gpu: &Arc<Gpu>, screen: Screen, worker: Worker) -> Self {
        Self {
            gpu: gpu.clone(),
            screen,
            worker,
            shown: [None, None],
            pointer: None,
            probed: None,
            pins: Vec::new(),
            actions: Vec::new(),
            answers: BTreeMap::new(),
            compares: false,
            in_f64: false,
            truth: false,
            on_cpu: Vec::new(),
        }
    }

    pub fn shown(&self, side: Side) -> Option<&Arc<Shown>> {
        self.shown[side as usize].as_ref()
    }

    pub fn act(&mut self, action: Action) {
        self.actions.push(action);
    }

    pub fn ask(&mut self, ask: Ask) -> u64 {
        self.worker.ask(ask)
    }

    pub fn answered(&mut self, number: u64, answer: Answer) {
        // what nobody has taken for a long time nobody will
        if self.answers.len() > 256 {
            self.answers.pop_first();
        }
        self.answers.insert(number, answer);
    }

    pub fn answer(&mut self, number: u64) -> Option<Answer> {
        self.answers.remove(&number)
    }
}
