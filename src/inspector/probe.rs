//! One place in everything that is shown: a pixel, the ground that it shows, and the sample, node, grid point and block that are there.

use std::sync::{Arc, OnceLock};

use glam::{DVec2, DVec3, UVec2};

use super::ask::Values;
use super::wish::Shown;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::{Gpu, Held};
use crate::look::channel::channels;
use crate::look::form::{OnMesh, Surface};
use crate::plan::product::{Drawn, Mesh, Product};
use crate::plan::{BufferId, Spread};

/// Where somebody points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Where {
    /// An element of a buffer.
    Element(u32, u32),
    /// World metres on the ground plane.
    Ground(DVec2),
    /// A place in the camera's picture, in pixels.
    Pixel(DVec2),
}

/// A place by all of its names, as far as it has them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spot {
    /// World metres.
    pub ground_m: Option<DVec3>,
    pub pixel: Option<DVec2>,
    /// Column and row of samples.
    pub sample: Option<DVec2>,
    /// Column and row of the nearest point of the grid.
    pub grid: Option<UVec2>,
    /// Where that point is in the square that the grid is over.
    pub place: Option<DVec2>,
}

/// A view that wants to know what it shows at a place.
#[derive(Clone)]
pub struct Asked {
    pub view: u64,
    pub values: Values,
    /// What the values are of: the buffer in the plan, if it is one.
    pub source: Option<BufferId>,
    /// Samples along a side of a node, if it shows a level of a pyramid.
    pub side: u32,
}

/// What a view shows there.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub view: u64,
    /// Name of the buffer.
    pub buffer: String,
    pub element: (u32, u32),
    /// Names of the element's numbers and their digits.
    pub numbers: Vec<(String, String)>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Probed {
    pub spot: Spot,
    pub lines: Vec<Line>,
}

impl Probed {
    /// All of it, to be copied.
    pub fn text(&self) -> String {
        let Spot { ground_m, pixel, sample, grid, place } = self.spot;
        let mut lines = Vec::new();
        if let Some(at) = ground_m {
            lines.push(format!("ground {:.3} m east, {:.3} m north, {:.3} m up", at.x, at.y, at.z));
        }
        if let Some(at) = pixel {
            lines.push(format!("pixel {:.1}, {:.1}", at.x, at.y));
        }
        if let Some(at) = sample {
            lines.push(format!("sample column {:.2}, row {:.2}", at.x, at.y));
        }
        if let Some(at) = grid {
            lines.push(format!("grid point column {}, row {}", at.x, at.y));
        }
        if let Some(at) = place {
            lines.push(format!("projector {:.4}, {:.4}", at.x, at.y));
        }
        for line in &self.lines {
            let numbers: Vec<String> = line.numbers.iter().map(|(name, text)| format!("{name} {text}")).collect();
            lines.push(format!("{} [{}, {}] {}", line.buffer, line.element.1, line.element.0, numbers.join(", ")));
        }
        lines.join("\n")
    }
}

/// Buffers of a frame on the host, each read once and only if somebody points.
#[derive(Default)]
pub struct Copies {
    distance_m: OnceLock<Vec<f32>>,
    /// Points of the grid relative to the eye, four numbers each, and their places in the square that it is over.
    points: OnceLock<Vec<f32>>,
    places: OnceLock<Vec<f32>>,
    list: OnceLock<Vec<u32>>,
}

fn copied<'a, T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
    gpu: &Gpu,
    held: Option<&Held>,
    copy: &'a OnceLock<Vec<T>>,
) -> Option<&'a [T]> {
    if copy.get().is_none() {
        let bytes = held?.read_all(gpu).ok()?;
        let _ = copy.set(bytemuck::pod_collect_to_vec(&bytes));
    }
    copy.get().map(Vec::as_slice)
}

/// Everything about a place, and what the views show there.
pub fn probe(gpu: &Gpu, shown: &Arc<Shown>, from: &Asked, at: Where, views: &[Asked]) -> Result<Probed, Diagnostic> {
    let prober = Prober { gpu, shown };
    let spot = prober.spot(from, at);
    let mut lines = Vec::new();
    for view in views {
        let is_own = view.view == from.view;
        let element = match at {
            Where::Element(column, row) if is_own => Some((column, row)),
            _ => prober.element(view, &spot),
        };
        if let Some(element) = element {
            lines.extend(line(gpu, view, element)?);
        }
    }
    Ok(Probed { spot, lines })
}

/// The numbers of one element; nothing beyond the buffer.
pub fn line(gpu: &Gpu, view: &Asked, (column, row): (u32, u32)) -> Result<Option<Line>, Diagnostic> {
    let Values { held, part, .. } = &view.values;
    if column >= part.columns || row >= part.rows {
        return Ok(None);
    }
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&held.read(gpu, (column, part.row + row), 1)?);
    let numbers = channels(&held.about).iter().map(|channel| (channel.name.clone(), channel.text(&words))).collect();
    Ok(Some(Line { view: view.view, buffer: held.about.name.clone(), element: (column, row), numbers }))
}

struct Prober<'a> {
    gpu: &'a Gpu,
    shown: &'a Shown,
}

impl Prober<'_> {
    fn spot(&self, from: &Asked, at: Where) -> Spot {
        match at {
            Where::Ground(ground) => self.spot_of_ground(ground),
            Where::Pixel(pixel) => self.spot_of_pixel(pixel),
            Where::Element(column, row) => self.spot_of_element(from, UVec2::new(column, row)),
        }
    }

    fn spot_of_element(&self, from: &Asked, element: UVec2) -> Spot {
        let centre = element.as_dvec2() + 0.5;
        match from.values.held.about.spread {
            Spread::Pixels => self.spot_of_pixel(centre),
            Spread::Tiles(side) => self.spot_of_pixel(centre * f64::from(side)),
            Spread::Samples => self.spot_of_sample(element.as_dvec2()),
            Spread::Nodes(_) => self.spot_of_sample(centre * f64::from(from.side)),
            Spread::GridPoints | Spread::GridCells => self.spot_of_grid(element),
            Spread::UnitSquare | Spread::UnitSquareCorners => {
                let (columns, rows) = from.values.held.size();
                let place = centre / DVec2::new(columns.into(), rows.into());
                self.nearest(self.places(), 2, place.extend(0.0))
                    .map_or(Spot::default(), |grid| self.spot_of_grid(grid))
            }
            Spread::Rows => Spot::default(),
            Spread::Numbers => match from.source.and_then(|id| self.shown.plan.known().surface(id)) {
                Some(Surface::Own(mesh)) => self.spot_of_listed(mesh, element.x),
                _ => Spot::default(),
            },
        }
    }

    fn spot_of_listed(&self, mesh: OnMesh, at: u32) -> Spot {
        let Some(words) = self.list(mesh) else { return Spot::default() };
        let sample = |packed: u32| DVec2::new((packed & 0xffff).into(), (packed >> 16).into());
        match mesh {
            OnMesh::Triangles(_) => {
                let Some(words) = words.chunks_exact(4).nth(at as usize) else { return Spot::default() };
                self.spot_of_sample((sample(words[0]) + sample(words[1]) + sample(words[2])) / 3.0)
            }
            OnMesh::Blocks(_) => {
                let Some(words) = words.chunks_exact(2).nth(at as usize) else { return Spot::default() };
                self.spot_of_sample(sample(words[0]) / 2.0)
            }
            OnMesh::Grid(_) => Spot::default(),
        }
    }

    fn spot_of_pixel(&self, pixel: DVec2) -> Spot {
        let camera = &self.shown.camera;
        let width = camera.viewport.0 as usize;
        let inside = pixel.cmpge(DVec2::ZERO).all() && pixel.x < f64::from(camera.viewport.0);
        let at = inside.then(|| pixel.y.floor() as usize * width + pixel.x.floor() as usize);
        let distance = at.and_then(|at| self.distance_m()?.get(at).copied()).filter(|distance| *distance >= 0.0);
        let Some(distance) = distance else { return Spot { pixel: Some(pixel), ..Spot::default() } };
        let ground = camera.eye_m + camera.ray(pixel.floor() + 0.5) * f64::from(distance);
        Spot { pixel: Some(pixel), ..self.spot_of_world(ground) }
    }

    fn spot_of_sample(&self, sample: DVec2) -> Spot {
        let lattice = self.shown.prepared.data.ground.lattice();
        let inside = sample.clamp(DVec2::ZERO, lattice.last().as_dvec2());
        self.spot_of_ground(lattice.world_from_sample(inside))
    }

    fn spot_of_ground(&self, ground: DVec2) -> Spot {
        let surface = self.shown.prepared.data.ground.surface_at(ground.extend(0.0));
        self.spot_of_world(ground.extend(surface.z))
    }

    fn spot_of_grid(&self, grid: UVec2) -> Spot {
        let Some((columns, _)) = self.grid_size() else { return Spot::default() };
        let at = (grid.y * columns + grid.x) as usize;
        let point = self.points().and_then(|points| points.chunks_exact(4).nth(at));
        let Some(point) = point else { return Spot { grid: Some(grid), ..Spot::default() } };
        let offset = DVec3::new(point[0].into(), point[1].into(), point[2].into());
        Spot { grid: Some(grid), place: self.place(grid), ..self.spot_of_world(self.shown.camera.eye_m + offset) }
    }

    fn spot_of_world(&self, world: DVec3) -> Spot {
        let Shown { camera, prepared, .. } = self.shown;
        let grid = self.nearest(self.points(), 4, world - camera.eye_m);
        Spot {
            ground_m: Some(world),
            pixel: camera.pixel(world),
            sample: Some(prepared.data.ground.lattice().sample_from_world(world.truncate())),
            grid,
            place: grid.and_then(|grid| self.place(grid)),
        }
    }

    fn place(&self, grid: UVec2) -> Option<DVec2> {
        let (columns, _) = self.grid_size()?;
        let place = self.places()?.chunks_exact(2).nth((grid.y * columns + grid.x) as usize)?;
        Some(DVec2::new(place[0].into(), place[1].into()))
    }

    /// The point of the grid whose first two numbers are nearest.
    fn nearest(&self, points: Option<&[f32]>, components: usize, to: DVec3) -> Option<UVec2> {
        let (columns, _) = self.grid_size()?;
        let off = |point: &[f32]| (f64::from(point[0]) - to.x).hypot(f64::from(point[1]) - to.y);
        let points = points?.chunks_exact(components).map(off).enumerate();
        let (at, _) = points.filter(|(_, off)| !off.is_nan()).min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(UVec2::new(at as u32 % columns, at as u32 / columns))
    }

    /// The element of a view that is at a place.
    fn element(&self, view: &Asked, spot: &Spot) -> Option<(u32, u32)> {
        let Values { held, part, .. } = &view.values;
        let whole = |at: DVec2| {
            let inside = at.cmpge(DVec2::ZERO).all();
            inside
                .then(|| (at.x.floor() as u32, at.y.floor() as u32))
                .filter(|at| at.0 < part.columns && at.1 < part.rows)
        };
        match held.about.spread {
            Spread::Pixels => whole(spot.pixel?),
            Spread::Tiles(side) => whole(spot.pixel? / f64::from(side.max(1))),
            Spread::Samples => whole(spot.sample? + 0.5),
            Spread::Nodes(_) => whole(spot.sample? / f64::from(view.side.max(1))),
            Spread::GridPoints => spot.grid.map(|grid| (grid.x, grid.y)),
            Spread::GridCells => spot.grid.map(|grid| (grid.x.min(part.columns - 1), grid.y.min(part.rows - 1))),
            Spread::UnitSquare | Spread::UnitSquareCorners => {
                whole(spot.place? * DVec2::new(part.columns.into(), part.rows.into()))
            }
            Spread::Rows => None,
            Spread::Numbers => match view.source.and_then(|id| self.shown.plan.known().surface(id)) {
                Some(Surface::Own(mesh)) => self.listed_at(mesh, spot.sample?).map(|at| (at, 0)),
                _ => None,
            },
        }
    }

    /// The number of the block or triangle that a place lies in.
    fn listed_at(&self, mesh: OnMesh, sample: DVec2) -> Option<u32> {
        let words = self.list(mesh)?;
        let place = |packed: u32| DVec2::new((packed & 0xffff).into(), (packed >> 16).into());
        let found = match mesh {
            OnMesh::Blocks(_) => words.chunks_exact(2).position(|words| {
                let half = f64::from(1u32 << words[0].trailing_zeros().min(15)) / 2.0;
                let off = (sample - place(words[0]) / 2.0).abs();
                off.max_element() <= half
            }),
            OnMesh::Triangles(_) => words.chunks_exact(4).position(|words| {
                let [a, b, c] = [0, 1, 2].map(|at| place(words[at]));
                let side = |from: DVec2, to: DVec2| (to - from).perp_dot(sample - from);
                let sides = [side(a, b), side(b, c), side(c, a)];
                sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
            }),
            OnMesh::Grid(_) => None,
        };
        found.map(|at| at as u32)
    }

    fn grid(&self) -> Option<BufferId> {
        Mesh::all(&self.shown.plan.products).iter().rev().find_map(|mesh: &Mesh<BufferId>| match mesh {
            Mesh::Grid(grid) => Some(grid.vertex),
            Mesh::List(_) => None,
        })
    }

    fn grid_size(&self) -> Option<(u32, u32)> {
        let &[rows, columns] = &self.shown.plan.buffer(self.grid()?).dims[..] else { return None };
        Some((columns, rows))
    }

    fn points(&self) -> Option<&[f32]> {
        copied(self.gpu, self.shown.companion(self.grid()?), &self.shown.copies.points)
    }

    fn places(&self) -> Option<&[f32]> {
        let buffers = &self.shown.plan.buffers;
        let is_place =
            |at: &usize| buffers[*at].spread == Spread::GridPoints && buffers[*at].elem == crate::kernel::Elem::Vec2F32;
        let ids = (0..buffers.len()).rev().filter(is_place).map(BufferId);
        let held = ids.into_iter().find_map(|id| self.shown.companion(id));
        copied(self.gpu, held, &self.shown.copies.places)
    }

    fn list(&self, mesh: OnMesh) -> Option<&[u32]> {
        let (OnMesh::Triangles(id) | OnMesh::Blocks(id) | OnMesh::Grid(id)) = mesh;
        let held = self.shown.companion(id)?;
        let words = copied(self.gpu, Some(held), &self.shown.copies.list)?;
        let counted = held.length as usize * held.about.elem.components() as usize;
        Some(&words[..words.len().min(counted)])
    }

    fn distance_m(&self) -> Option<&[f32]> {
        let drawn: Drawn<BufferId> = self.shown.plan.products.latest()?;
        copied(self.gpu, self.shown.companion(drawn.distance), &self.shown.copies.distance_m)
    }
}
