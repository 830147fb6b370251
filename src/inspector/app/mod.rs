//! The window: its panes, what they ask for, and the worker's answers.

mod bars;
mod layout;

use std::path::Path;
use std::sync::Arc;

use egui::{Color32, Frame, Ui};
use egui_tiles::TileId;

use super::ask::Ask;
use super::desk::{Action, Desk};
use super::document::Document;
use super::panes::experiments::ExperimentsPane;
use super::panes::results::ResultsPane;
use super::probe::{Asked, Probed, Where, probe};
use super::screen::Screen;
use super::shot::Shot;
use super::view::{Against, Of, View};
use super::watch::Watch;
use super::wish::{Answer, CellName, Moment, Shown, Side, Told, Wish};
use super::worker::{Wake, Worker};
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Gpu;
use layout::{Panes, USUAL, default_layout, usual, views_of};

pub use layout::{Layout, Pane};

/// One of the two sides, as somebody wants it.
struct Wanted {
    document: Option<Document>,
    cell: CellName,
    /// The frame of the path, where it is another one than that of the first side.
    frame: Option<usize>,
    sent: Option<Wish>,
    refused: Option<Diagnostic>,
}

pub struct App {
    desk: Desk,
    layout: Layout,
    experiments: ExperimentsPane,
    results: ResultsPane,
    wanted: [Wanted; 2],
    moment: Moment,
    /// What stands at the bottom.
    said: Option<Result<String, Diagnostic>>,
    working: Option<(String, Option<f32>)>,
    probing: Option<u64>,
    asked_for: Option<(u64, Where)>,
    watch: Watch,
    /// Steps are timed when nothing else is to be done.
    times: bool,
    broken: bool,
    /// Only the views are drawn, beside each other.
    only_views: bool,
}

impl App {
    pub fn new(gpu: &Arc<Gpu>, screen: Screen, wake: Wake, layout: Option<Layout>) -> Self {
        let worker = Worker::new(gpu, wake);
        let wanted = || Wanted { document: None, cell: CellName::default(), frame: None, sent: None, refused: None };
        Self {
            desk: Desk::new(gpu, screen, worker),
            layout: layout.unwrap_or_else(default_layout),
            experiments: ExperimentsPane::default(),
            results: ResultsPane::default(),
            wanted: [wanted(), wanted()],
            moment: Moment::Frame(0),
            said: None,
            working: None,
            probing: None,
            asked_for: None,
            watch: Watch::default(),
            times: true,
            broken: false,
            only_views: false,
        }
    }

    pub fn desk(&self) -> &Desk {
        &self.desk
    }

    pub fn results(&self) -> &ResultsPane {
        &self.results
    }

    /// Opens an experiment on both sides.
    pub fn open(&mut self, path: &Path) {
        match Document::load(path) {
            Ok(document) => {
                for wanted in &mut self.wanted {
                    wanted.document = Some(document.clone());
                    wanted.cell = CellName::default();
                    wanted.frame = None;
                    wanted.refused = None;
                }
                self.desk.shown = [None, None];
                // another ground, and most often other buffers
                for (at, view) in self.views_mut().into_iter().enumerate() {
                    (view.place, view.orbit) = (None, None);
                    if at < USUAL {
                        view.turn_to(Side::A, Of::Buffer(String::new()));
                    }
                }
                self.moment = Moment::Frame(0);
                self.desk.on_cpu.clear();
                self.desk.pins.clear();
                self.said = None;
            }
            Err(error) => self.said = Some(Err(error)),
        }
    }

    /// Does what a pane asks for.
    pub fn act(&mut self, action: Action) {
        match action {
            Action::See { side, of, in_new } => self.see(side, of, in_new),
            Action::Close(id) => self.close(id),
            Action::Set { side, path, value } => {
                if let Some(document) = &mut self.wanted[side as usize].document {
                    document.changed.insert(path, value);
                }
            }
            Action::Reset { side, path } => {
                if let Some(document) = &mut self.wanted[side as usize].document {
                    match path {
                        Some(path) => drop(document.changed.remove(&path)),
                        None => document.changed.clear(),
                    }
                }
            }
            Action::Choose { side, cell } => self.wanted[side as usize].cell = cell,
            Action::Move(moment) => self.moment = moment,
            Action::OnCpu { stage, on } => {
                self.desk.on_cpu.retain(|known| *known != stage);
                if on {
                    self.desk.on_cpu.push(stage);
                }
            }
            Action::Open(path) => self.open(&path),
            Action::SaveAs(path) => self.save_as(&path),
            Action::OpenResults(folder) => {
                self.results.open(&folder);
                self.layout.tree.make_active(|_, tile| matches!(tile, egui_tiles::Tile::Pane(Pane::Results)));
            }
            Action::Say(said) => self.said = Some(said),
            Action::InF64(in_f64) => self.desk.in_f64 = in_f64,
            Action::Truth(truth) => self.desk.truth = truth,
            Action::Source(kernel) => {
                let tiles = self.layout.tree.tiles.tiles_mut();
                for tile in tiles {
                    if let egui_tiles::Tile::Pane(Pane::Source(source)) = tile {
                        source.kernel = kernel.clone();
                    }
                }
                self.layout.tree.make_active(|_, tile| matches!(tile, egui_tiles::Tile::Pane(Pane::Source(_))));
            }
        }
    }

    fn save_as(&mut self, path: &Path) {
        let [first, _] = &mut self.wanted;
        let Some(document) = &mut first.document else { return };
        self.said = Some(document.save_as(path).map(|()| format!("saved as {}", path.display())));
    }

    fn see(&mut self, side: Side, of: Of, in_new: bool) {
        if of.needs_truth() {
            self.desk.truth = true;
        }
        let views = self.views_mut();
        match views.into_iter().next() {
            Some(view) if !in_new => view.turn_to(side, of),
            _ => {
                let id = self.layout.next_view;
                self.layout.next_view += 1;
                let pane = Pane::View(Box::new(View::new(id, side, of)));
                let tile = self.layout.tree.tiles.insert_pane(pane);
                self.place_view(tile);
            }
        }
    }

    /// Puts a new view beside the others.
    fn place_view(&mut self, tile: TileId) {
        let tiles = &self.layout.tree.tiles;
        let beside = tiles.iter().find_map(|(id, known)| match known {
            egui_tiles::Tile::Pane(Pane::View(_)) if *id != tile => tiles.parent_of(*id),
            _ => None,
        });
        match beside.or(self.layout.tree.root()) {
            Some(parent) => self.layout.tree.move_tile_to_container(tile, parent, usize::MAX, false),
            None => self.layout.tree.root = Some(tile),
        }
    }

    fn close(&mut self, id: u64) {
        let is_it =
            |tile: &egui_tiles::Tile<Pane>| matches!(tile, egui_tiles::Tile::Pane(Pane::View(view)) if view.id == id);
        let found = self.layout.tree.tiles.iter().find(|(_, tile)| is_it(tile)).map(|(id, _)| *id);
        if let Some(tile) = found {
            self.layout.tree.remove_recursively(tile);
        }
    }

    /// The views in the order in which they were opened.
    pub fn views_mut(&mut self) -> Vec<&mut View> {
        views_of(&mut self.layout)
    }

    /// Whether each step is timed when there is nothing else to do.
    pub fn time_steps(&mut self, times: bool) {
        self.times = times;
    }

    /// From now on there is nothing but the views.
    pub fn show_only_views(&mut self) {
        self.only_views = true;
    }

    /// Nothing is on its way, so that what is drawn now is what there is to see.
    pub fn is_settled(&self) -> bool {
        let waits = self.layout.tree.tiles.tiles().any(|tile| match tile {
            egui_tiles::Tile::Pane(Pane::View(view)) => view.waits(),
            _ => false,
        });
        !self.desk.worker.is_busy() && self.probing.is_none() && !waits
    }

    pub fn refused(&self, side: Side) -> Option<&Diagnostic> {
        self.wanted[side as usize].refused.as_ref()
    }

    pub fn said(&self) -> Option<&Result<String, Diagnostic>> {
        self.said.as_ref()
    }

    /// Takes in what the worker has to say.
    pub fn hear(&mut self) {
        for told in self.desk.worker.told() {
            match told {
                Told::Shown(side, shown) => self.take(side, shown),
                Told::Refused(side, wish, error) => {
                    let wanted = &mut self.wanted[side as usize];
                    if wanted.sent.as_ref() == Some(wish.as_ref()) {
                        wanted.refused = Some(error);
                    }
                }
                Told::Working { what, share } => self.working = Some((what, share)),
                Told::Idle(_) => self.working = None,
                Told::Answer(number, answer) => match answer {
                    Answer::Probed(probed) if self.probing == Some(number) => {
                        self.probing = None;
                        self.desk.probed = probed.ok();
                    }
                    Answer::Done(done) => self.said = Some(done),
                    answer => self.desk.answered(number, answer),
                },
            }
        }
    }

    fn take(&mut self, side: Side, shown: Arc<Shown>) {
        let wanted = &mut self.wanted[side as usize];
        // a mistake that was corrected is none any more
        if wanted.sent.as_ref() == Some(&shown.wish) {
            wanted.refused = None;
        }
        if wanted.cell.chain.is_empty() {
            let cell = &shown.prepared.cell;
            wanted.cell = CellName { chain: cell.chain.clone(), settings: cell.settings.clone() };
        }
        let usual = usual(&shown);
        for (view, of) in self.views_mut().into_iter().zip(usual) {
            if view.of == Of::Buffer(String::new()) {
                view.turn_to(Side::A, of);
            }
        }
        self.watch.follow(&shown);
        self.desk.shown[side as usize] = Some(shown);
    }

    /// Sends the worker what is wanted now, if that is another thing than before.
    fn send(&mut self) {
        let buffers = self.buffers();
        for side in Side::BOTH {
            if side == Side::B && !self.desk.compares {
                continue;
            }
            let is_busy = self.desk.worker.is_busy();
            let wanted = &mut self.wanted[side as usize];
            let Some(document) = wanted.document.clone() else { continue };
            let buffers = buffers[side as usize].clone();
            let mut wish = Wish {
                document,
                cell: wanted.cell.clone(),
                moment: wanted.frame.map_or(self.moment, Moment::Frame),
                buffers,
                on_cpu: self.desk.on_cpu.clone(),
                in_f64: self.desk.in_f64,
                truth: self.desk.truth,
                times: false,
                kernels: self.watch.number(),
            };
            let is_new = wanted.sent.as_ref().is_none_or(|sent| Wish { times: false, ..sent.clone() } != wish);
            if is_new {
                self.desk.worker.wish(side, wish.clone());
                wanted.sent = Some(wish);
            } else if self.times
                && !is_busy
                && wanted.refused.is_none()
                && wanted.sent.as_ref().is_some_and(|sent| !sent.times)
            {
                // nobody waits for anything: the steps are timed
                wish.times = true;
                self.desk.worker.wish(side, wish.clone());
                wanted.sent = Some(wish);
            }
        }
    }

    /// The buffers that the views are of, for each side.
    fn buffers(&mut self) -> [Vec<String>; 2] {
        let mut buffers = [Vec::new(), Vec::new()];
        for view in self.views_mut() {
            // nothing is known yet of what the chain has
            let Of::Buffer(name) = &view.of else { continue };
            if name.is_empty() {
                continue;
            }
            buffers[view.side as usize].push(name.clone());
            if view.against == Against::Other {
                let other = if view.side == Side::A { Side::B } else { Side::A };
                buffers[other as usize].push(name.clone());
            }
        }
        for names in &mut buffers {
            names.sort();
            names.dedup();
        }
        buffers
    }

    /// What is at a place of a view, at once.
    pub fn point(&self, view_id: u64, at: Where) -> Result<Probed, Diagnostic> {
        let (from, shown, views) =
            self.asked(view_id).ok_or_else(|| Diagnostic::input(format!("view {view_id} has nothing to point at")))?;
        probe(&self.desk.gpu, &shown, &from, at, &views)
    }

    /// Asks what is at the place where the hand is, once the last answer is there.
    fn probe(&mut self) {
        let Some((view_id, at)) = self.desk.pointer else {
            self.asked_for = None;
            return;
        };
        let asked_for = Some((view_id, at));
        if self.probing.is_some() || asked_for == self.asked_for && self.desk.probed.is_some() {
            return;
        }
        let Some((from, shown, views)) = self.asked(view_id) else { return };
        self.asked_for = asked_for;
        self.probing = Some(self.desk.ask(Ask::Probe { shown, from, at, views }));
    }

    /// A view, what it shows, and what the others have to be told of a place in it.
    fn asked(&self, view_id: u64) -> Option<(Asked, Arc<Shown>, Vec<Asked>)> {
        let desk = &self.desk;
        let views: Vec<&View> = self
            .layout
            .tree
            .tiles
            .tiles()
            .filter_map(|tile| match tile {
                egui_tiles::Tile::Pane(Pane::View(view)) => Some(view.as_ref()),
                _ => None,
            })
            .collect();
        let asked = views.iter().filter_map(|view| view.asked(desk)).collect::<Vec<_>>();
        let own = views.iter().find(|view| view.id == view_id)?;
        let shown = desk.shown(own.side).cloned()?;
        let from = asked.iter().find(|asked| asked.view == view_id).cloned()?;
        Some((from, shown, asked))
    }

    /// One frame of the window.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.hear();
        if self.watch.has_changed(ui.input(|input| input.time)) {
            ui.ctx().request_repaint();
        }
        if let Err(error) = self.desk.gpu.check()
            && !self.broken
        {
            self.broken = true;
            let error = Diagnostic::from(error).help("what was shown last stays; start the inspector again to go on");
            self.said = Some(Err(error));
        }
        // nothing is filled: the window is cleared to its colour, and on a CPU each pixel that is painted once more counts
        let middle = Frame::central_panel(ui.style()).fill(Color32::TRANSPARENT);
        if self.only_views {
            egui::CentralPanel::default().frame(middle).show(ui, |ui| self.views(ui));
        } else {
            self.window(ui, middle);
        }
        for action in std::mem::take(&mut self.desk.actions) {
            self.act(action);
        }
        if !self.broken {
            self.send();
            self.probe();
        }
        if !self.is_settled() {
            ui.ctx().request_repaint_after(std::time::Duration::from_millis(30));
        }
    }

    /// The views beside each other.
    fn views(&mut self, ui: &mut Ui) {
        let Self { layout, desk, .. } = self;
        let mut views = views_of(layout);
        ui.columns(views.len().max(1), |columns| {
            for (column, view) in columns.iter_mut().zip(&mut views) {
                view.ui(column, desk);
            }
        });
    }

    /// Everything.
    fn window(&mut self, ui: &mut Ui, middle: Frame) {
        let bar = Frame::side_top_panel(ui.style()).fill(Color32::TRANSPARENT);
        egui::Panel::top("top").frame(bar).show(ui, |ui| self.top(ui));
        egui::Panel::bottom("bottom").frame(bar).show(ui, |ui| self.bottom(ui));
        egui::CentralPanel::default().frame(middle).show(ui, |ui| match self.wanted[0].document.is_some() {
            false => self.experiments.ui(ui, &mut self.desk),
            true => {
                self.desk.pointer = None;
                let mut panes = Panes {
                    desk: &mut self.desk,
                    experiments: &mut self.experiments,
                    results: &mut self.results,
                    refused: self.wanted.each_ref().map(|wanted| wanted.refused.clone()),
                    closed: Vec::new(),
                };
                self.layout.tree.ui(&mut panes, ui);
                let closed = panes.closed;
                closed.into_iter().for_each(|id| self.close(id));
            }
        });
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        App::ui(self, ui);
    }

    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        self.desk.screen.background(visuals)
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        eframe::set_value(storage, LAYOUT, &self.layout);
    }
}

/// Under which name the layout is kept.
pub const LAYOUT: &str = "layout";

/// A window on an experiment, or on the list of those that ship.
pub fn window(gpu: &Arc<Gpu>, shot: &Shot) -> Result<(), Diagnostic> {
    let options = Screen::options(gpu);
    let (gpu, shot) = (gpu.clone(), shot.clone());
    // a mistake on the command line is told there
    if let Some(file) = &shot.file {
        crate::experiment::Experiment::load(file)?;
    }
    let create = move |context: &eframe::CreationContext<'_>| {
        let state = context.wgpu_render_state.as_ref().ok_or("the window has no wgpu device")?;
        let screen = Screen::of_window(&gpu, state);
        let repaint = context.egui_ctx.clone();
        let wake: Wake = Arc::new(move || repaint.request_repaint());
        let layout = context.storage.and_then(|storage| eframe::get_value(storage, LAYOUT));
        let mut app = App::new(&gpu, screen, wake, layout);
        shot.prepare(&mut app)?;
        Ok(Box::new(app) as Box<dyn eframe::App>)
    };
    eframe::run_native("lodlab", options, Box::new(create)).map_err(|error| {
        Diagnostic::run(format!("the window cannot be opened: {error}"))
            .help("`--screenshot OUT.png` needs no window; on Debian, `scripts/inspect` gets the libraries of X11")
    })
}
