//! The tiles of the window: which there are, how each is drawn, and where they are at first.

use egui::Ui;
use egui_tiles::{TileId, Tiles, Tree};
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::inspector::desk::Desk;
use crate::inspector::panes::camera::CameraPane;
use crate::inspector::panes::chain::ChainPane;
use crate::inspector::panes::experiments::ExperimentsPane;
use crate::inspector::panes::parameters::ParametersPane;
use crate::inspector::panes::probe;
use crate::inspector::panes::results::ResultsPane;
use crate::inspector::panes::source::SourcePane;
use crate::inspector::view::{Of, View};
use crate::inspector::wish::{Shown, Side};
use crate::plan::BufferId;
use crate::plan::product::{Drawn, Mesh, Picture};

/// One tile of the window.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Pane {
    Chain(ChainPane),
    Parameters(ParametersPane),
    Camera(CameraPane),
    Probe,
    Source(SourcePane),
    Results,
    Experiments,
    View(Box<View>),
}

/// What is kept from one time to the next.
#[derive(Serialize, Deserialize)]
pub struct Layout {
    pub(super) tree: Tree<Pane>,
    pub(super) next_view: u64,
}

/// Draws tiles.
pub(super) struct Panes<'a> {
    pub(super) desk: &'a mut Desk,
    pub(super) experiments: &'a mut ExperimentsPane,
    pub(super) results: &'a mut ResultsPane,
    pub(super) refused: [Option<Diagnostic>; 2],
    pub(super) closed: Vec<u64>,
}

impl egui_tiles::Behavior<Pane> for Panes<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, pane: &mut Pane) -> egui_tiles::UiResponse {
        egui::Frame::NONE.inner_margin(4.0).show(ui, |ui| match pane {
            Pane::Chain(chain) => chain.ui(ui, self.desk),
            Pane::Parameters(parameters) => {
                let refused = self.refused[parameters.side as usize].as_ref();
                parameters.ui(ui, self.desk, refused);
            }
            Pane::Camera(camera) => camera.ui(ui, self.desk),
            Pane::Probe => probe::ui(ui, self.desk),
            Pane::Source(source) => source.ui(ui, self.desk, self.refused[0].as_ref()),
            Pane::Results => self.results.ui(ui, self.desk),
            Pane::Experiments => self.experiments.ui(ui, self.desk),
            Pane::View(view) => view.ui(ui, self.desk),
        });
        egui_tiles::UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> egui::WidgetText {
        match pane {
            Pane::Chain(_) => "chain".into(),
            Pane::Parameters(_) => "parameters".into(),
            Pane::Camera(_) => "camera".into(),
            Pane::Probe => "probe".into(),
            Pane::Source(_) => "source".into(),
            Pane::Results => "results".into(),
            Pane::Experiments => "experiments".into(),
            Pane::View(view) => view.of.name().into(),
        }
    }

    fn is_tab_closable(&self, tiles: &Tiles<Pane>, tile: TileId) -> bool {
        matches!(tiles.get_pane(&tile), Some(Pane::View(_)))
    }

    fn on_tab_close(&mut self, tiles: &mut Tiles<Pane>, tile: TileId) -> bool {
        if let Some(Pane::View(view)) = tiles.get_pane(&tile) {
            self.closed.push(view.id);
        }
        false
    }

    fn simplification_options(&self) -> egui_tiles::SimplificationOptions {
        egui_tiles::SimplificationOptions { all_panes_must_have_tabs: true, ..Default::default() }
    }
}

/// Chain, parameters and the others on the left, two views on the right.
pub(super) fn default_layout() -> Layout {
    let mut tiles = Tiles::default();
    let upper: Vec<TileId> =
        [Pane::Chain(ChainPane::default()), Pane::Source(SourcePane::default()), Pane::Results, Pane::Experiments]
            .into_iter()
            .map(|pane| tiles.insert_pane(pane))
            .collect();
    let lower: Vec<TileId> =
        [Pane::Parameters(ParametersPane::default()), Pane::Camera(CameraPane::default()), Pane::Probe]
            .into_iter()
            .map(|pane| tiles.insert_pane(pane))
            .collect();
    let upper = tiles.insert_tab_tile(upper);
    let lower = tiles.insert_tab_tile(lower);
    let left = tiles.insert_vertical_tile(vec![upper, lower]);
    let open = Of::Buffer(String::new());
    let views = [0, 1].map(|id| tiles.insert_pane(Pane::View(Box::new(View::new(id, Side::A, open.clone())))));
    let views = views.to_vec();
    let right = tiles.insert_vertical_tile(views);
    let root = tiles.insert_horizontal_tile(vec![left, right]);
    if let Some(egui_tiles::Tile::Container(egui_tiles::Container::Linear(row))) = tiles.get_mut(root) {
        row.shares.set_share(left, 0.38);
        row.shares.set_share(right, 0.62);
    }
    Layout { tree: Tree::new(egui::Id::unique("tiles"), root, tiles), next_view: 2 }
}

pub(super) fn views_of(layout: &mut Layout) -> Vec<&mut View> {
    let tiles = layout.tree.tiles.tiles_mut();
    let mut views: Vec<&mut View> = tiles
        .filter_map(|tile| match tile {
            egui_tiles::Tile::Pane(Pane::View(view)) => Some(view.as_mut()),
            _ => None,
        })
        .collect();
    views.sort_by_key(|view| view.id);
    views
}

/// So many views are of what a chain is for, until somebody chooses something else.
pub(super) const USUAL: usize = 2;

/// What the views of a new window are of: the chain's picture (or whatever it makes last), and the mesh that it draws (or the distances, or
/// the ground).
pub(super) fn usual(shown: &Shown) -> [Of; USUAL] {
    let plan = &shown.run_plan;
    let name = |id: BufferId| plan.buffer(id).name.clone();
    let last = plan.steps.last().and_then(|step| step.writes.first().copied());
    let picture = plan.products.latest::<Picture<BufferId>>().map(|picture| picture.pixels).or(last);
    let mesh = plan.products.latest::<Mesh<BufferId>>().map(|mesh| match mesh {
        Mesh::Grid(grid) => grid.vertex,
        Mesh::List(list) => list.triangle,
    });
    let drawn = plan.products.latest::<Drawn<BufferId>>().map(|drawn| drawn.distance);
    let second = mesh.or(drawn).or((!plan.buffers.is_empty()).then_some(BufferId(0)));
    [picture, second].map(|id| Of::Buffer(id.map(name).unwrap_or_default()))
}
