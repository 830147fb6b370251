//! A view: one buffer after one step, in one form, with what it is compared with.

mod bar;
mod image;
mod legend;
mod paint;
mod plot;
mod space;
mod table;

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::ask::{Ask, Seen, Values};
use super::desk::Desk;
use super::probe::Asked;
use super::wish::{Answer, Shown, Side};
use crate::gpu::Held;
use crate::gpu::paint::{Part, Tones};
use crate::look::channel::{Channel, Kind, channels};
use crate::look::scale::Scaled;
use crate::look::{Colours, Form, Range, Scale};
use crate::plan::BufferId;
use crate::run::sight::{usual_channel, usual_colours};

/// What a view is of.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Of {
    /// A buffer as `--dump` names it.
    Buffer(String),
    TruthDistance,
    TruthPicture,
    ScreenError,
}

impl Of {
    pub fn name(&self) -> &str {
        match self {
            Of::Buffer(name) => name,
            Of::TruthDistance => "ground truth: distance",
            Of::TruthPicture => "ground truth: picture",
            Of::ScreenError => "screen-space error",
        }
    }

    pub fn needs_truth(&self) -> bool {
        !matches!(self, Of::Buffer(_))
    }
}

/// What it is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Against {
    #[default]
    Nothing,
    /// The stage's reference, given what its kernels were given.
    F64,
    /// The same buffer of the other side.
    Other,
    /// Distances and pictures of the ground truth.
    Truth,
}

/// How two are seen at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    #[default]
    Difference,
    Beside,
    Wipe,
    Flicker,
    /// Only what it is compared with.
    Second,
}

impl Mode {
    pub const ALL: [Mode; 5] = [Mode::Difference, Mode::Beside, Mode::Wipe, Mode::Flicker, Mode::Second];

    pub fn name(self) -> &'static str {
        match self {
            Mode::Difference => "difference",
            Mode::Beside => "side by side",
            Mode::Wipe => "wipe",
            Mode::Flicker => "flicker",
            Mode::Second => "only the second",
        }
    }
}

/// What a plane is seen from: the place in the middle, and pixels of the screen for each element (or metre).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    pub centre: [f64; 2],
    pub scale: f64,
}

/// The camera that looks at a mesh from any side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Orbit {
    pub yaw_deg: f64,
    pub pitch_deg: f64,
    pub distance_m: f64,
    pub target_m: [f64; 3],
}

/// Values are looked at no more often.
const STATISTICS_EVERY: Duration = Duration::from_millis(200);

/// All that is kept of a view.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct View {
    pub id: u64,
    pub side: Side,
    pub of: Of,
    pub form: Option<Form>,
    /// Which number of an element; without, the most telling one.
    pub channel: Option<usize>,
    pub colours: Option<Colours>,
    pub range: Range,
    pub scale: Scale,
    pub level: usize,
    pub against: Against,
    pub mode: Mode,
    pub wipe: f32,
    /// Lines between the points of a mesh, and triangles filled.
    pub lines: bool,
    pub filled: bool,
    /// Values above that of the list, or of the threshold, are marked.
    pub marks: bool,
    pub place: Option<Place>,
    pub orbit: Option<Orbit>,
    #[serde(skip)]
    live: Live,
}

/// What a view has of the frame that it shows.
#[derive(Default)]
struct Live {
    painted: [Option<paint::Painted>; 2],
    seen: Option<Seen>,
    /// What was asked about, with the number of the question.
    asked: Option<(u64, SeenKey)>,
    seen_for: Option<SeenKey>,
    asked_at: Option<Instant>,
    /// What is shown is newer than what is known of its values.
    waits: bool,
    rows: table::Rows,
    trouble: Option<String>,
    /// What is seen of a plane, and where in the window.
    looked: Option<image::Looked>,
}

impl Clone for Live {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl std::fmt::Debug for Live {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("Live")
    }
}

/// What statistics depend on.
#[derive(Clone, Debug, PartialEq)]
struct SeenKey {
    shown: [u64; 2],
    of: Of,
    channel: Option<usize>,
    form: Form,
    level: usize,
    against: Against,
    is_difference: bool,
    range: Range,
    scale: Scale,
}

/// What is shown, found in what there is.
pub(super) struct Found {
    pub held: Held,
    pub channels: Vec<Channel>,
    pub channel: Channel,
    /// What it is compared with.
    pub second: Option<(Held, Channel)>,
    pub part: Part,
    /// Samples along a side of an element, if it is a level of a pyramid.
    pub side: u32,
    pub source: Option<BufferId>,
    pub forms: Vec<Form>,
    pub form: Form,
}

impl View {
    pub fn new(id: u64, side: Side, of: Of) -> Self {
        Self {
            id,
            side,
            of,
            form: None,
            channel: None,
            colours: None,
            range: Range::Auto,
            scale: Scale::Linear,
            level: 0,
            against: Against::Nothing,
            mode: Mode::Difference,
            wipe: 0.5,
            lines: true,
            filled: true,
            marks: true,
            place: None,
            orbit: None,
            live: Live::default(),
        }
    }

    /// Shows another buffer in the same way, as far as it has it.
    pub fn turn_to(&mut self, side: Side, of: Of) {
        let (id, lines, filled) = (self.id, self.lines, self.filled);
        self.close();
        *self = Self { lines, filled, ..Self::new(id, side, of) };
    }

    /// Drops what it has on the device.
    pub fn close(&mut self) {
        self.live = Live::default();
    }

    /// What to show, or why there is nothing.
    pub(super) fn found(&self, desk: &Desk) -> Result<Found, String> {
        let shown = desk.shown(self.side).ok_or("nothing is shown yet")?;
        let held = held_of(shown, &self.of).ok_or_else(|| match &self.of {
            Of::Buffer(name) if shown.wish.buffers.contains(name) => {
                format!("the chain `{}` has no `{name}`", shown.plan.chain)
            }
            Of::Buffer(name) => format!("`{name}` is on its way"),
            _ => "the ground truth is on its way".into(),
        })?;
        let channels = channels(&held.about);
        let source = match &self.of {
            Of::Buffer(name) => shown.source(name),
            _ => None,
        };
        let forms = match source {
            Some(id) => shown.plan.known().forms(id),
            None => vec![Form::Image, Form::Table],
        };
        let form = self.form.filter(|form| forms.contains(form)).unwrap_or(forms[0]);
        let at = self.channel.unwrap_or_else(|| source.map_or(0, |id| usual_channel(&shown.plan, id, form)));
        let channel = channels.get(at).or(channels.first()).cloned().ok_or("it has no numbers")?;
        let (mut part, mut side) = (Part::all(held), 1);
        let levels = held.about.spread.levels(held.about.top_level);
        if form == Form::Levels
            && let Some(level) = levels.get(self.level.min(levels.len().saturating_sub(1)))
        {
            part = Part { row: level.row, columns: level.columns, rows: level.rows };
            side = level.side;
        }
        let second = self.second(desk, shown, &channel)?;
        Ok(Found { held: held.clone(), channels, channel, second, part, side, source, forms, form })
    }

    /// What it is compared with.
    fn second(&self, desk: &Desk, shown: &Shown, channel: &Channel) -> Result<Option<(Held, Channel)>, String> {
        let own = |held: &Held| {
            let all = channels(&held.about);
            let same = all.iter().find(|own| own.name == channel.name);
            same.or(all.first()).cloned().map(|channel| (held.clone(), channel))
        };
        let Some(own_about) = held_of(shown, &self.of).map(|held| &held.about) else { return Ok(None) };
        match self.against {
            Against::Nothing => Ok(None),
            Against::Other => {
                let other = if self.side == Side::A { Side::B } else { Side::A };
                let there = desk.shown(other).and_then(|shown| held_of(shown, &self.of));
                let there = there.ok_or("the other side has no such buffer")?;
                if there.about.dims != own_about.dims {
                    return Err("the other side's buffer has another size".into());
                }
                Ok(own(there))
            }
            Against::Truth => {
                let truth = shown.truth.as_ref().ok_or("the ground truth is on its way")?;
                let is_like = |held: &&Held| held.about.elem == own_about.elem && held.about.unit == own_about.unit;
                let found = [&truth.distance, &truth.picture].into_iter().find(is_like);
                let found = found.filter(|held| held.about.dims == own_about.dims);
                Ok(own(found.ok_or("the ground truth has distances and a picture, and nothing like this")?))
            }
            Against::F64 => {
                let Of::Buffer(name) = &self.of else { return Err("it is in f64".into()) };
                let found = f64_of(shown, name).ok_or("no reference makes this buffer, or not by this step")?;
                let all = channels(&found.held.about);
                // the picture's four bytes in one channel have no one number
                let at = if channel.kind == Kind::Colour { 0 } else { self.numbered(channel, shown, name) };
                let second = all.get(at).cloned().ok_or("its reference has no such number")?;
                Ok(Some((found.held.clone(), second)))
            }
        }
    }

    /// Which of the numbers of an element it is, for a reference, which has no bits.
    fn numbered(&self, channel: &Channel, shown: &Shown, name: &str) -> usize {
        let Some(held) = shown.held(name) else { return 0 };
        match held.about.packing {
            crate::kernel::Packing::Bytes => (channel.shift / 8) as usize,
            crate::kernel::Packing::Halves => (channel.shift / 16) as usize,
            crate::kernel::Packing::None => channel.word as usize,
        }
    }

    fn is_difference(&self, found: &Found) -> bool {
        found.second.is_some() && self.mode == Mode::Difference
    }

    /// The values whose statistics are shown.
    pub(super) fn values(&self, found: &Found) -> Values {
        let only_second = found.second.is_some() && self.mode == Mode::Second;
        match (&found.second, only_second) {
            (Some((held, channel)), true) => {
                Values { held: held.clone(), channel: channel.clone(), minus: None, part: found.part }
            }
            (second, _) => Values {
                held: found.held.clone(),
                channel: found.channel.clone(),
                minus: second.clone().filter(|_| self.is_difference(found)),
                part: found.part,
            },
        }
    }

    /// Something about what it shows is not known yet.
    pub fn waits(&self) -> bool {
        self.live.waits
    }

    /// Where an element is in the window, if it is seen as one.
    pub fn point_of(&self, element: (u32, u32)) -> Option<egui::Pos2> {
        let looked = self.live.looked.as_ref()?;
        Some(looked.point_of([f64::from(element.0) + 0.5, f64::from(element.1) + 0.5]))
    }

    /// What it has to be told for a place that somebody points at.
    pub fn asked(&self, desk: &Desk) -> Option<Asked> {
        let found = self.found(desk).ok()?;
        let values = Values { held: found.held.clone(), channel: found.channel.clone(), minus: None, part: found.part };
        Some(Asked { view: self.id, values, source: found.source, side: found.side })
    }

    /// The colours of values: a range that is not known yet is that of the frame before.
    fn tones(&self, found: &Found) -> Tones {
        let is_difference = self.is_difference(found);
        let usual = || usual_colours(&found.held, &found.channel);
        let default = if is_difference { Colours::RedBlue } else { usual() };
        let mut scaled = match (self.range, &self.live.seen) {
            (Range::Manual(low, high), _) => Scaled::new(low, high, self.scale),
            (_, Some(seen)) => seen.scaled,
            (_, None) => Scaled::new(0.0, 1.0, self.scale),
        };
        if is_difference && self.range == Range::Auto {
            // nothing is in the middle
            let most = scaled.low.abs().max(scaled.high.abs());
            scaled = Scaled { low: -most, high: most, ..scaled };
        }
        Tones { colours: self.colours.unwrap_or(default), scaled, mark_above: None }
    }

    /// Asks for statistics where they are not known, and takes in what was answered.
    fn keep_seen(&mut self, desk: &mut Desk, found: &Found) {
        if found.channel.kind == Kind::Colour && !self.is_difference(found) {
            self.live.seen = None;
            self.live.waits = false;
            return;
        }
        if let Some((number, key)) = self.live.asked.clone()
            && let Some(Answer::Statistics(answer)) = desk.answer(number)
        {
            self.live.asked = None;
            match answer {
                Ok(seen) => {
                    self.live.seen = Some(seen);
                    self.live.seen_for = Some(key);
                }
                Err(error) => self.live.trouble = Some(error.to_string()),
            }
        }
        let number = |side: Side| desk.shown(side).map_or(u64::MAX, |shown| shown.number);
        let key = SeenKey {
            shown: [number(Side::A), number(Side::B)],
            of: self.of.clone(),
            channel: self.channel,
            form: found.form,
            level: self.level,
            against: self.against,
            is_difference: self.is_difference(found),
            range: self.range,
            scale: self.scale,
        };
        let is_known = self.live.seen_for.as_ref() == Some(&key);
        self.live.waits = !is_known;
        // while frames come one after another, they go before what their values are like
        let is_time = self.live.asked_at.is_none_or(|at| at.elapsed() >= STATISTICS_EVERY);
        if !is_known && self.live.asked.is_none() && is_time {
            self.live.asked_at = Some(Instant::now());
            let of = self.values(found);
            let number = desk.ask(Ask::Statistics { of, range: self.range, scale: self.scale });
            self.live.asked = Some((number, key));
        }
    }

    /// The whole view.
    pub fn ui(&mut self, ui: &mut egui::Ui, desk: &mut Desk) {
        self.bar(ui, desk);
        let found = match self.found(desk) {
            Ok(found) => found,
            Err(why) => {
                ui.weak(why);
                return;
            }
        };
        self.keep_seen(desk, &found);
        match found.form {
            Form::Image | Form::Levels => self.image(ui, desk, &found),
            Form::Table => self.table(ui, desk, &found),
            Form::Plot => self.plot(ui, desk, &found),
            Form::Figure | Form::Above | Form::View | Form::Orbit => self.space(ui, desk, &found),
        }
        if let Some(trouble) = &self.live.trouble {
            ui.colored_label(egui::Color32::LIGHT_RED, trouble);
        }
    }
}

/// What is shown under a name.
pub(super) fn held_of<'a>(shown: &'a Shown, of: &Of) -> Option<&'a Held> {
    let truth = shown.truth.as_deref();
    match of {
        Of::Buffer(name) => shown.held(name),
        Of::TruthDistance => truth.map(|truth| &truth.distance),
        Of::TruthPicture => truth.map(|truth| &truth.picture),
        Of::ScreenError => truth.map(|truth| &truth.error),
    }
}

/// The f64 result for a buffer, as it is after the stage of its step.
pub(super) fn f64_of<'a>(shown: &'a Shown, name: &str) -> Option<&'a super::wish::F64Shown> {
    let known = match name.split_once('@') {
        None => shown.in_f64.get(name),
        Some((buffer, step)) => {
            let at = shown.step_names.iter().position(|known| known == step)?;
            let stage_index = shown.plan.steps[at].stage_index;
            shown.in_f64.get(&format!("{buffer}#{stage_index}"))
        }
    };
    known.map(AsRef::as_ref)
}
