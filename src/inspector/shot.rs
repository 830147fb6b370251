//! A picture of the inspector without a window: the same panes through the same code.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::app::App;
use super::desk::Action;
use super::export;
use super::screen::Screen;
use super::view::{Against, Mode, Of, View};
use super::wish::{CellName, Moment, Side};
use crate::experiment::Experiment;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Gpu;
use crate::look::{Form, Range};

/// What is to be seen in a picture.
#[derive(Clone, Debug, Default)]
pub struct Shot {
    pub file: Option<PathBuf>,
    pub out: PathBuf,
    /// `--set` arguments.
    pub set: Vec<String>,
    pub chain: Option<String>,
    /// Buffers, each in a view of its own; `truth`, `truth-distance` and `screen-error` are those of the ground truth.
    pub buffers: Vec<String>,
    pub after: Option<String>,
    pub frame: usize,
    /// The form of the views: `image`, `above`, `view`, `orbit`, `levels`, `figure`, `plot`, `table`.
    pub form: Option<String>,
    pub range: Option<(f32, f32)>,
    pub level: Option<u32>,
    /// `f64` or `truth`.
    pub against: Option<String>,
    /// Only the views, without the window around them.
    pub only_views: bool,
    /// Opened besides, in the results pane.
    pub results: Option<PathBuf>,
    pub size: (u32, u32),
}

/// Longer than this nothing takes that a picture is made of.
const MOST: Duration = Duration::from_secs(600);

/// Frames in which panes find out their sizes.
const SETTLING: usize = 4;

impl Shot {
    /// Makes the picture.
    pub fn take(&self, gpu: &Arc<Gpu>) -> Result<(), Diagnostic> {
        let screen = Screen::without_window(gpu);
        let mut app = App::new(gpu, screen.clone(), Arc::new(|| ()), None);
        self.prepare(&mut app)?;
        if self.only_views {
            app.show_only_views();
        }
        let context = egui::Context::default();
        let output = self.settle(&mut app, &context, &screen)?;
        let ([width, _], pixels) = screen.picture(&context, output)?;
        export::picture(&self.out, width, &pixels)
    }

    /// Opens what is wanted.
    pub(super) fn prepare(&self, app: &mut App) -> Result<(), Diagnostic> {
        let Some(file) = &self.file else { return Ok(()) };
        let experiment = Experiment::load(file)?;
        let settings = self.set.iter().map(|set| crate::experiment::sweep::read_setting(set));
        let settings = settings.collect::<Result<Vec<_>, _>>()?;
        let cells = experiment.cells(&settings)?;
        app.open(file);
        for setting in &settings {
            let value = setting.value.origin.text().to_string();
            app.act(Action::Set { side: Side::A, path: setting.path.clone(), value });
        }
        if let Some(chain) = &self.chain {
            let found = cells.iter().find(|cell| cell.chain == *chain || cell.label() == *chain);
            let mut names: Vec<&str> = cells.iter().map(|cell| cell.chain.as_str()).collect();
            names.dedup();
            let found = found.ok_or_else(|| {
                Diagnostic::input(format!("the experiment has no chain `{chain}`")).suggest(chain, names)
            })?;
            let cell = CellName { chain: found.chain.clone(), settings: found.settings.clone() };
            app.act(Action::Choose { side: Side::A, cell });
        }
        app.act(Action::Move(Moment::Frame(self.frame)));
        if let Some(results) = &self.results {
            app.act(Action::OpenResults(results.clone()));
        }
        self.views(app)
    }

    fn views(&self, app: &mut App) -> Result<(), Diagnostic> {
        let form = self.form.as_deref().map(form_of).transpose()?;
        let against = match self.against.as_deref() {
            None => Against::Nothing,
            Some("f64") => Against::F64,
            Some("truth") => Against::Truth,
            Some(other) => {
                let error = Diagnostic::input(format!("nothing can be compared with `{other}`"));
                return Err(error.suggest(other, ["f64", "truth"]));
            }
        };
        match against {
            Against::F64 => app.act(Action::InF64(true)),
            Against::Truth => app.act(Action::Truth(true)),
            _ => {}
        }
        for (at, buffer) in self.buffers.iter().enumerate() {
            let of = match buffer.as_str() {
                "truth" => Of::TruthPicture,
                "truth-distance" => Of::TruthDistance,
                "screen-error" => Of::ScreenError,
                name => Of::Buffer(match &self.after {
                    Some(step) if !name.contains('@') => format!("{name}@{step}"),
                    _ => name.into(),
                }),
            };
            if of.needs_truth() {
                app.act(Action::Truth(true));
            }
            match app.views_mut().into_iter().nth(at) {
                Some(view) => view.turn_to(Side::A, of),
                None => app.act(Action::See { side: Side::A, of, in_new: true }),
            }
        }
        if self.buffers.is_empty() {
            return Ok(());
        }
        if self.buffers.len() == 1
            && let Some(id) = app.views_mut().get(1).map(|view| view.id)
        {
            app.act(Action::Close(id));
        }
        for view in app.views_mut() {
            self.set_up(view, form, against);
        }
        Ok(())
    }

    fn set_up(&self, view: &mut View, form: Option<Form>, against: Against) {
        view.form = form.or(view.form);
        view.against = against;
        view.mode = Mode::Difference;
        if let Some((low, high)) = self.range {
            view.range = Range::Manual(low, high);
        }
        if let Some(level) = self.level {
            view.level = level.saturating_sub(1) as usize;
        }
    }

    /// Refuses buffers that the chain does not have.
    fn check(&self, app: &App) -> Result<(), Diagnostic> {
        let Some(shown) = app.desk().shown(Side::A) else { return Ok(()) };
        let mut absent = shown.wish.buffers.iter().filter(|name| !name.is_empty() && shown.held(name).is_none());
        absent.try_for_each(|name| shown.plan.find(name).map(|_| ()))
    }

    /// Draws until nothing is on its way.
    fn settle(&self, app: &mut App, context: &egui::Context, screen: &Screen) -> Result<egui::FullOutput, Diagnostic> {
        let start = Instant::now();
        let mut quiet = 0;
        loop {
            let size = egui::vec2(self.size.0 as f32, self.size.1 as f32);
            let input = egui::RawInput {
                screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, size)),
                time: Some(start.elapsed().as_secs_f64()),
                ..Default::default()
            };
            let mut output = context.run_ui(input, |ui| app.ui(ui));
            screen.take(&mut output.textures_delta);
            if let Some(error) = app.refused(Side::A) {
                return Err(error.clone());
            }
            if let Some(Err(error)) = app.said() {
                return Err(error.clone());
            }
            quiet = if app.is_settled() { quiet + 1 } else { 0 };
            if quiet > SETTLING {
                self.check(app)?;
                return Ok(output);
            }
            if start.elapsed() > MOST {
                return Err(Diagnostic::run("the picture was not done after ten minutes"));
            }
            if quiet == 0 {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    }
}

fn form_of(name: &str) -> Result<Form, Diagnostic> {
    Form::ALL
        .into_iter()
        .find(|form| form.name() == name)
        .ok_or_else(|| Diagnostic::input(format!("there is no look `{name}`")).suggest(name, Form::ALL.map(Form::name)))
}
