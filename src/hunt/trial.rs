//! What is tried: a terrain, a chain and some views, drawn at random, as text and simpler.

use std::fmt;
use std::path::PathBuf;

use glam::{DVec2, DVec3, UVec2};
use rand::RngExt;
use rand::rngs::ChaCha12Rng as Dice;

use crate::experiment::diagnostic::Source as Text;
use crate::experiment::parameters::{Limits, ParameterKind, describe};
use crate::experiment::scene::{Detail, Surface};
use crate::experiment::tree::Node;
use crate::stages;

/// Views that one trial looks from: a chain is planned once for all of them.
const VIEWS: usize = 16;

#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    pub terrain: Terrain,
    pub surface: Surface,
    /// Octaves over the terrain.
    pub detail: Detail,
    /// Stages as they are written.
    pub chain: Vec<String>,
    /// Values of parameters, by their paths.
    pub settings: Vec<(String, String)>,
    pub views: Vec<View>,
    pub viewport_px: UVec2,
    pub fov_deg: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    pub source: Source,
    pub size: UVec2,
    pub cell_m: DVec2,
    /// Lowest height, and the range above it.
    pub low_m: f64,
    pub range_m: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    Noise {
        kind: &'static str,
        seed: u32,
        waves: f64,
        octaves: u32,
    },
    Shape {
        kind: &'static str,
        period_cells: u32,
    },
    /// A file, from a sample on; its heights are as they are.
    Dem {
        file: PathBuf,
        from: UVec2,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct View {
    pub eye_m: DVec3,
    /// Above the ground, whatever the eye's own height is.
    pub clearance_m: Option<f64>,
    pub yaw_deg: f64,
    pub pitch_deg: f64,
    pub roll_deg: f64,
}

/// A number whose logarithm is even between two.
fn about(dice: &mut Dice, low: f64, high: f64) -> f64 {
    rounded(low * (high / low).powf(dice.random_range(0.0..1.0)))
}

/// As it can be written with few digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

fn one_of<T: Clone>(dice: &mut Dice, of: &[T]) -> T {
    of[dice.random_range(0..of.len())].clone()
}

impl Terrain {
    fn roll(dice: &mut Dice, dems: &[(PathBuf, UVec2)]) -> Self {
        let side = |dice: &mut Dice| one_of(dice, &[2, 5, 16, 33, 64, 65, 129, 200]);
        let size = UVec2::new(side(dice), side(dice));
        let cell_m = about(dice, 0.1, 300.0);
        // half of them are as there are on Earth
        let is_plain = dice.random_bool(0.5);
        let ratio = if is_plain { one_of(dice, &[1.0, 1.0, 0.7]) } else { about(dice, 0.01, 100.0) };
        let cell_m = DVec2::new(cell_m, rounded(cell_m * ratio));
        let extent_m = ((size - 1).as_dvec2() * cell_m).max_element();
        let range_m = if is_plain { rounded(extent_m * about(dice, 0.01, 0.5)) } else { about(dice, 1e-3, 1e5) };
        let low_m = one_of(dice, &[0.0, -5000.0, 3000.0, -0.5 * range_m]);
        let source = match dice.random_range(0..10) {
            0..=1 => Source::Shape {
                kind: one_of(dice, &["Ramp", "GaussianHill", "Spike", "Cliff", "Checkerboard", "Sine"]),
                period_cells: one_of(dice, &[2, 3, 8]),
            },
            2..=4 if !dems.is_empty() => {
                let (file, whole) = one_of(dice, dems);
                let size = size.min(whole);
                let from = whole - size;
                let from = UVec2::new(dice.random_range(0..=from.x), dice.random_range(0..=from.y));
                return Self { source: Source::Dem { file, from }, size, cell_m, low_m, range_m };
            }
            _ => Source::Noise {
                kind: one_of(dice, &["Fbm", "Ridged", "Billow", "Hybrid", "DomainWarped"]),
                seed: dice.random_range(0..100_000),
                waves: about(dice, 0.5, 40.0),
                octaves: one_of(dice, &[1, 4, 8]),
            },
        };
        Self { source, size, cell_m, low_m, range_m }
    }

    fn extent_m(&self) -> DVec2 {
        (self.size - 1).as_dvec2() * self.cell_m
    }

    fn simpler(&self) -> Vec<Self> {
        let halved = UVec2::new((self.size.x / 2).max(2), (self.size.y / 2).max(2));
        let mut all = vec![
            Self { size: halved, ..self.clone() },
            Self { cell_m: DVec2::splat(self.cell_m.x), ..self.clone() },
            Self { cell_m: self.cell_m.map(|cell_m| cell_m.round().max(1.0)), ..self.clone() },
            Self { low_m: 0.0, ..self.clone() },
            Self { range_m: self.range_m.round().max(1.0), ..self.clone() },
        ];
        if let Source::Noise { kind, seed, waves, .. } = self.source {
            all.push(Self { source: Source::Noise { kind, seed, waves, octaves: 1 }, ..self.clone() });
            all.push(Self {
                source: Source::Noise { kind, seed, waves: waves.round().max(1.0), octaves: 1 },
                ..self.clone()
            });
        }
        all
    }
}

impl View {
    fn roll(dice: &mut Dice, terrain: &Terrain) -> Self {
        if dice.random_bool(0.5) { Self::on_foot(dice, terrain) } else { Self::anywhere(dice, terrain) }
    }

    /// As somebody stands there, or flies low: where a bound has most to hold, since a hair's breadth aside is another place.
    fn on_foot(dice: &mut Dice, terrain: &Terrain) -> Self {
        let share = DVec2::new(dice.random_range(0.0..1.0), dice.random_range(0.0..1.0));
        Self {
            eye_m: (share * terrain.extent_m()).map(rounded).extend(rounded(terrain.low_m)),
            clearance_m: Some(about(dice, 0.05, 50.0)),
            yaw_deg: rounded(dice.random_range(-180.0..180.0)),
            pitch_deg: rounded(dice.random_range(-15.0..5.0)),
            roll_deg: 0.0,
        }
    }

    fn anywhere(dice: &mut Dice, terrain: &Terrain) -> Self {
        let inside = DVec2::new(dice.random_range(0.0..1.0), dice.random_range(0.0..1.0));
        let share = match dice.random_range(0..10) {
            0 => {
                one_of(dice, &[DVec2::ZERO, DVec2::ONE, DVec2::new(0.0, 0.5), DVec2::new(0.5, 1.0), DVec2::splat(0.5)])
            }
            // on a border, on a line of the grid
            1 => DVec2::new(0.0, inside.y),
            2 => (inside * (terrain.size - 1).as_dvec2()).round() / (terrain.size - 1).as_dvec2(),
            // outside
            3 => inside * 3.0 - 1.0,
            _ => inside,
        };
        let ground_m = (share * terrain.extent_m()).map(rounded);
        let high_m = terrain.low_m + terrain.range_m;
        let (z_m, clearance_m) = match dice.random_range(0..10) {
            // under the ground, and high above it
            0 => (terrain.low_m - terrain.range_m * dice.random_range(0.0..1.0), None),
            1 => (high_m + terrain.extent_m().max_element() * dice.random_range(0.0..3.0), None),
            _ => (terrain.low_m, Some(one_of(dice, &[0.0, 0.01, 0.05, 0.3, 1.7, 10.0, 100.0]))),
        };
        let any_deg = dice.random_range(-180.0..180.0);
        Self {
            eye_m: ground_m.extend(rounded(z_m)),
            clearance_m,
            yaw_deg: rounded(one_of(dice, &[0.0, 90.0, 180.0, 45.0, any_deg, any_deg, any_deg])),
            pitch_deg: rounded(one_of(dice, &[0.0, -1.0, -8.0, -30.0, -90.0, 10.0, 0.4 * any_deg, 0.4 * any_deg])),
            roll_deg: rounded(one_of(dice, &[0.0, 0.0, 0.0, any_deg])),
        }
    }

    fn simpler(&self) -> Vec<Self> {
        vec![
            Self { roll_deg: 0.0, ..self.clone() },
            Self { pitch_deg: self.pitch_deg.round(), ..self.clone() },
            Self { yaw_deg: self.yaw_deg.round(), ..self.clone() },
            Self { eye_m: self.eye_m.round(), ..self.clone() },
        ]
    }
}

/// Other values for some parameters of a chain: numbers within their limits and not far from what they are, other choices.
fn vary(dice: &mut Dice, chain: &[String]) -> Vec<(String, String)> {
    let mut settings = Vec::new();
    for stage in chain {
        let Ok(node) = Node::read(&Text::new("stage", stage.as_str())) else { continue };
        let name = node.name().unwrap_or_default();
        let Some(entry) = stages::find(name) else { continue };
        for parameter in describe(&(entry.info.parameters)()) {
            let own = node.field(&parameter.name).map(Node::canonical).or(parameter.default.clone());
            let value = match parameter.kind {
                ParameterKind::Numbers { count, is_whole, limits } if dice.random_bool(0.4) => {
                    other_numbers(dice, &own.unwrap_or_default(), (count, is_whole), limits)
                }
                ParameterKind::Flag if dice.random_bool(0.1) => Some(one_of(dice, &["true", "false"]).to_string()),
                ParameterKind::Choice if dice.random_bool(0.3) => Some(one_of(dice, &parameter.choices).0),
                _ => None,
            };
            settings.extend(value.map(|value| (format!("*.{name}.{}", parameter.name), value)));
        }
    }
    settings
}

fn other_numbers(dice: &mut Dice, own: &str, (count, is_whole): (usize, bool), limits: Limits) -> Option<String> {
    let numbers = own.trim_matches(['(', ')']).split(',').filter_map(|number| number.trim().parse().ok());
    let varied = numbers.map(|number: f64| {
        let least = if is_whole { 0.25 } else { 0.05 };
        let value = rounded(number.max(0.0) * about(dice, least, 2.5));
        let value = if is_whole { value.round() } else { value };
        let value = value.max(limits.least.unwrap_or(f64::MIN)).min(limits.most.unwrap_or(f64::MAX));
        // what is made of it is small
        if count == 2 { value.min(96.0) } else { value }.to_string()
    });
    let varied: Vec<String> = varied.collect();
    match varied.len() {
        1 if count == 1 => Some(varied[0].clone()),
        several => (several == count).then(|| format!("({})", varied.join(", "))),
    }
}

/// Octaves as there are on the ground, and as there are on none.
fn roll_detail(dice: &mut Dice, terrain: &Terrain) -> Detail {
    let far = dice.random_range(-1_000_000_000..1_000_000_000);
    Detail {
        octaves: one_of(dice, &[1, 2, 4, 8, 30]),
        amplitude_m: rounded(terrain.cell_m.min_element() * about(dice, 1e-3, 1.0)),
        persistence: one_of(dice, &[0.3, 0.45, 0.5, 0.5, 0.8]),
        seed: dice.random_range(0..100_000),
        origin: one_of(dice, &[(0, 0), (0, 0), (-1, 1), (far, -far)]),
    }
}

fn simpler_details(detail: &Detail) -> [Detail; 5] {
    [
        Detail::default(),
        Detail { octaves: detail.octaves / 2, ..*detail },
        Detail { octaves: detail.octaves.saturating_sub(1), ..*detail },
        Detail { persistence: 0.5, seed: 0, ..*detail },
        Detail { origin: (0, 0), ..*detail },
    ]
}

fn written(detail: &Detail) -> String {
    let Detail { octaves, amplitude_m, persistence, seed, origin } = detail;
    match octaves {
        0 => "()".into(),
        _ => format!(
            "(octaves: {octaves}, amplitude_m: {amplitude_m:?}, persistence: {persistence:?}, seed: {seed}, origin: {origin:?})"
        ),
    }
}

impl Trial {
    /// `chains` are those that can be drawn, each with the surface that it is only for.
    pub fn roll(dice: &mut Dice, chains: &[super::Known], dems: &[(PathBuf, UVec2)]) -> Self {
        let terrain = Terrain::roll(dice, dems);
        let (mut chain, only_on) = one_of(dice, chains);
        let surface = only_on.unwrap_or_else(|| one_of(dice, &[Surface::Triangles, Surface::Bilinear]));
        // without some stages a chain is another method, or none
        if dice.random_bool(0.3) {
            let first = dice.random_range(1..chain.len());
            let last = (first + dice.random_range(1..3)).min(chain.len() - 1);
            chain.drain(first..last);
        }
        let settings = vary(dice, &chain);
        let detail = if dice.random_bool(0.2) { roll_detail(dice, &terrain) } else { Detail::default() };
        let views = (0..VIEWS).map(|_| View::roll(dice, &terrain)).collect();
        let viewport_px =
            one_of(dice, &[UVec2::new(64, 48), UVec2::new(160, 120), UVec2::new(33, 81), UVec2::new(129, 97)]);
        Self {
            terrain,
            surface,
            detail,
            chain,
            settings,
            views,
            viewport_px,
            fov_deg: one_of(dice, &[20.0, 60.0, 60.0, 100.0]),
        }
    }

    /// What is left if one thing of it is made simpler; one of its views is what it is about.
    pub fn simpler(&self, view: usize) -> Vec<Self> {
        let mut all = Vec::new();
        if self.views.len() > 1 {
            // alone, a view can keep what it broke where a chain was planned for others, too
            all.push(Self { views: vec![self.views[view].clone()], ..self.clone() });
            let others = (0..self.views.len()).filter(|other| *other != view);
            all.extend(
                others
                    .map(|other| Self { views: [view, other].map(|at| self.views[at].clone()).into(), ..self.clone() }),
            );
        }
        all.extend(self.terrain.simpler().into_iter().map(|terrain| Self { terrain, ..self.clone() }));
        all.extend((0..self.settings.len()).map(|at| {
            let mut simpler = self.clone();
            simpler.settings.remove(at);
            simpler
        }));
        if let [view] = &self.views[..] {
            all.extend(view.simpler().into_iter().map(|view| Self { views: vec![view], ..self.clone() }));
        }
        all.extend(simpler_details(&self.detail).into_iter().map(|detail| Self { detail, ..self.clone() }));
        all.push(Self { fov_deg: 60.0, ..self.clone() });
        all.push(Self { viewport_px: UVec2::new(64, 48), ..self.clone() });
        all.retain(|simpler| simpler != self);
        all
    }

    /// The experiment, whose camera path stands at one of the views.
    pub fn experiment(&self, view: usize) -> String {
        let others = self.views.iter().enumerate().filter(|(other, _)| *other != view);
        let others: String = others.map(|(_, view)| format!("// planned for this eye, too: {view}\n")).collect();
        others
            + &format!(
                "Experiment(\n    scene: (\n        terrain: {},\n        surface: {:?},\n        detail: {},\n        camera: {},\n        viewport: ({}, {}),\n        \
             fov_deg: {:?},\n    ),\n    chains: {{\"found\": [{}]}},\n    measure: [ScreenError, Mesh],\n)\n",
                self.terrain,
                self.surface,
                written(&self.detail),
                self.views[view],
                self.viewport_px.x,
                self.viewport_px.y,
                self.fov_deg,
                self.chain.join(", "),
            )
    }
}

impl fmt::Display for Terrain {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { source, size, cell_m, low_m, range_m } = self;
        let high_m = low_m + range_m;
        let cells = format!("cell_m: ({:?}, {:?})", cell_m.x, cell_m.y);
        match source {
            Source::Noise { kind, seed, waves, octaves } => {
                let wavelength_m = self.extent_m().max_element() / waves;
                write!(
                    f,
                    "Noise(kind: {kind}, seed: {seed}, size: ({}, {}), {cells}, height_m: ({low_m:?}, {high_m:?}), \
                     wavelength_m: {wavelength_m:?}, octaves: {octaves})",
                    size.x, size.y
                )
            }
            Source::Shape { kind, period_cells } => write!(
                f,
                "Shape(kind: {kind}, size: ({}, {}), {cells}, height_m: ({low_m:?}, {high_m:?}), period_cells: {period_cells})",
                size.x, size.y
            ),
            Source::Dem { file, from } => {
                write!(f, "Dem(file: {:?}, {cells}, crop: ({}, {}, {}, {}))", file, from.x, from.y, size.x, size.y)
            }
        }
    }
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let DVec3 { x, y, z } = self.eye_m;
        write!(f, "Still(eye: ({x:?}, {y:?}, {z:?})")?;
        if let Some(clearance_m) = self.clearance_m {
            write!(f, ", clearance_m: {clearance_m:?}")?;
        }
        write!(f, ", yaw_deg: {:?}, pitch_deg: {:?}, roll_deg: {:?})", self.yaw_deg, self.pitch_deg, self.roll_deg)
    }
}
