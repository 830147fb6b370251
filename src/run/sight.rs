//! What a frame looks like: buffers of a plan drawn on the ground, in the camera's picture, from any side, or as a plane figure.
//!
//! Somebody who looks at a plan's buffers needs others beside them: the points of the grid that an importance lies on, the heights under a
//! list of triangles. [`companions`] names them, and a [`Sight`] draws with them.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, UVec2};

use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::paint::{Canvas, Clip, Colouring, Image, Lattice, Listed, MeshImage, Part, Points, Tones};
use crate::gpu::statistics::Looked;
use crate::gpu::{Executor, Gpu, GpuError, Held};
use crate::look::channel::{Channel, channels};
use crate::look::form::{Known, OnMesh, Surface};
use crate::look::scale::Scaled;
use crate::look::{Colours, Form, Projection, Scale};
use crate::plan::product::{Blocks, Drawn, Mesh, Picture, Product};
use crate::plan::{BufferId, Chain, Plan, Spread, Work};
use crate::scene::{HEIGHT, SceneData};

/// The buffers that looks need besides those that they are of, as far as `run_plan` makes them anyway. An array of more than `largest` bytes
/// is not asked for.
pub fn companions(chain: &Chain, looked_at: &[BufferId], run_plan: &Plan, largest: u64) -> Vec<BufferId> {
    let (known, products) = (Known::of_chain(chain), chain.products());
    let mut ids: Vec<BufferId> = Vec::new();
    for mesh in Mesh::all(products) {
        match mesh {
            Mesh::Grid(grid) => ids.push(grid.vertex),
            Mesh::List(list) => ids.extend([list.triangle, list.count]),
        }
    }
    ids.extend(Blocks::all(products).iter().flat_map(|blocks: &Blocks<BufferId>| [blocks.leaf, blocks.count]));
    ids.extend(products.latest::<Drawn<BufferId>>().map(|drawn| drawn.distance));
    ids.extend(products.latest::<Picture<BufferId>>().map(|picture| picture.pixels));
    ids.retain(|id| run_plan.lives(*id));
    if chain.buffer(chain.ground()).bytes() <= largest {
        ids.push(chain.ground());
    }
    for &id in looked_at {
        let source = chain.steps().iter().find_map(|step| match step.work {
            Work::Copy { from, to } if to == id => Some(from),
            _ => None,
        });
        ids.extend(known.companions(source.unwrap_or(id)));
    }
    ids.sort();
    ids.dedup();
    ids
}

/// A frame that somebody looks at.
#[derive(Clone, Copy)]
pub struct Sight<'a> {
    pub plan: &'a Plan,
    pub data: &'a SceneData,
    /// The camera that the frame was made for.
    pub camera: &'a Camera,
    /// Buffers of the plan that are held.
    pub held: &'a dyn Fn(BufferId) -> Option<&'a Held>,
    /// What lies under meshes in the camera's picture, where the chain makes none.
    pub other_picture: Option<&'a Held>,
}

/// A buffer that is looked at.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    pub held: &'a Held,
    pub channel: &'a Channel,
    /// What it is in the plan, or what it is a copy of.
    pub source: Option<BufferId>,
}

/// The plane that a canvas is a part of: left, top, right and bottom, in the units of its form.
///
/// [`Form::Above`] has metres east and metres *south* of the north-west sample, [`Form::View`] pixels, [`Form::Figure`] the projector's
/// image, the others elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    pub low: DVec2,
    pub high: DVec2,
}

/// How meshes are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    pub lines: bool,
    pub filled: bool,
    pub tones: Tones,
}

/// Clip space of points that are relative to an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Through {
    pub projection: Projection,
    pub origin_m: DVec3,
}

const DARK_LINE: u32 = 0xff20_2020;
const BRIGHT_LINE: u32 = 0xffe0_e0e0;
/// Pixels that a triangle has at least, on average, where lines are drawn around it: more would hide its colour.
const ROOM_PX: f64 = 24.0;
/// Where nothing is.
const EMPTY: [f64; 3] = [0.08, 0.08, 0.1];

impl<'a> Sight<'a> {
    /// All of the plane of a form.
    pub fn whole(&self, form: Form, part: Part) -> Extent {
        let high = match form {
            Form::Above => self.data.ground.lattice().extent_m(),
            Form::View => DVec2::new(self.camera.viewport.0.into(), self.camera.viewport.1.into()),
            Form::Figure | Form::Orbit => DVec2::ONE,
            _ => DVec2::new(part.columns.into(), part.rows.into()),
        };
        Extent { low: DVec2::ZERO, high: high.max(DVec2::splat(1e-9)) }
    }

    /// What a form is drawn through; from any side it is a camera of its own.
    pub fn through(&self, form: Form, extent: &Extent, orbit: Option<&Camera>) -> Through {
        let Extent { low, high } = *extent;
        let eye_m = self.camera.eye_m;
        match (form, orbit) {
            (Form::Above, _) => {
                let north_m = self.data.ground.lattice().extent_m().y;
                let (south_west, north_east) =
                    (DVec2::new(low.x, north_m - high.y), DVec2::new(high.x, north_m - low.y));
                let eye = eye_m.truncate();
                Through { projection: Projection::plane(south_west - eye, north_east - eye), origin_m: eye_m }
            }
            (Form::View, _) => {
                let size = DVec2::new(self.camera.viewport.0.into(), self.camera.viewport.1.into());
                let ndc = |x: f64, y: f64| DVec2::new(x / size.x * 2.0 - 1.0, 1.0 - y / size.y * 2.0);
                let whole = Projection::camera(self.camera, eye_m);
                Through { projection: whole.cropped(ndc(low.x, high.y), ndc(high.x, low.y)), origin_m: eye_m }
            }
            (Form::Orbit, Some(camera)) => Through { projection: Projection::camera(camera, eye_m), origin_m: eye_m },
            // the figure's first row is at the top, like that of a picture
            _ => {
                let projection = Projection::plane(DVec2::new(low.x, high.y), DVec2::new(high.x, low.y));
                Through { projection, origin_m: DVec3::ZERO }
            }
        }
    }

    /// Paints a buffer in a form that is drawn in space or as a figure.
    pub fn paint(
        &self,
        gpu: &Gpu,
        canvas: &Canvas,
        seen: &Seen<'a>,
        form: Form,
        (extent, through): (&Extent, &Through),
        style: &Style,
    ) -> Result<(), GpuError> {
        let over = self.paint_under(gpu, canvas, seen, form, extent, style.tones)?;
        let lattice = self.ground(through.origin_m);
        let drawn = self.drawn_on(seen, form, lattice.as_ref());
        let mut meshes = Vec::new();
        if let Some((points, colouring)) = drawn {
            let is_figure = form == Form::Figure;
            let whole = self.whole(form, Part { row: 0, columns: 1, rows: 1 });
            let zoom = (whole.high - whole.low) / (extent.high - extent.low);
            let room_px = f64::from(canvas.size.0) * f64::from(canvas.size.1) * (zoom.x * zoom.y).abs();
            let lines = is_figure || style.lines && primitives(&points) * ROOM_PX <= room_px;
            let colouring = (!is_figure && (style.filled || !lines)).then_some(colouring);
            let line = if colouring.is_none() { BRIGHT_LINE } else { DARK_LINE };
            let mesh = |is_filled, colouring, lift, is_sheer| MeshImage {
                points,
                projection: through.projection,
                is_filled,
                colouring,
                tones: style.tones,
                lift,
                is_sheer,
            };
            // over the picture, what is filled lets it through
            meshes.extend(colouring.map(|colouring| mesh(true, colouring, 0.0, form == Form::View)));
            meshes.extend(lines.then(|| mesh(false, Colouring::One(line), 1e-4, form == Form::View)));
        }
        gpu.paint_meshes(canvas, over, self.clip(canvas, form, extent), &meshes)
    }

    /// The camera's picture ends where it ends.
    fn clip(&self, canvas: &Canvas, form: Form, extent: &Extent) -> Option<Clip> {
        if form != Form::View {
            return None;
        }
        let pixels = DVec2::new(canvas.size.0.into(), canvas.size.1.into());
        let Extent { low, high } = self.whole(form, Part { row: 0, columns: 1, rows: 1 });
        let corner = |at: DVec2| ((at - extent.low) / (extent.high - extent.low) * pixels).round().max(DVec2::ZERO);
        let corner = |at: DVec2| (corner(at).x as u32, corner(at).y as u32);
        Some(Clip { low: corner(low), high: corner(high) })
    }

    /// What is under a mesh: the ground from above, the picture in the view, or a colour.
    fn paint_under(
        &self,
        gpu: &Gpu,
        canvas: &Canvas,
        seen: &Seen,
        form: Form,
        extent: &Extent,
        tones: Tones,
    ) -> Result<Option<[f64; 3]>, GpuError> {
        let pixels = DVec2::new(canvas.size.0.into(), canvas.size.1.into());
        let step = (extent.high - extent.low) / pixels;
        let image = |held: &Held, channel: &Channel, origin: DVec2, step: DVec2, tones: Tones| {
            let part = Part::all(held);
            let (origin, step) = (origin.as_vec2().to_array(), step.as_vec2().to_array());
            gpu.paint_image(canvas, &Image { held, channel, minus: None, part, origin, step, tones }).map(|()| None)
        };
        match form {
            Form::Above => {
                let cell_m = self.data.ground.lattice().cell_m;
                // the middle of the first element is the first sample
                let (origin, step) = (extent.low / cell_m + 0.5, step / cell_m);
                let is_map = seen.source.and_then(|id| self.plan.known().surface(id)) == Some(Surface::Map);
                match (is_map, self.heights()) {
                    (true, _) => image(seen.held, seen.channel, origin, step, tones),
                    (false, Some(heights)) => {
                        image(heights, &channels(&heights.about)[0], origin, step, self.ground_tones())
                    }
                    (false, None) => Ok(Some(EMPTY)),
                }
            }
            Form::View => {
                let picture: Option<Picture<BufferId>> = Picture::all(&self.plan.products).last().copied();
                let held = picture.and_then(|picture| (self.held)(picture.pixels)).or(self.other_picture);
                match held {
                    Some(held) => image(held, &channels(&held.about)[0], extent.low, step, tones),
                    None => Ok(Some(EMPTY)),
                }
            }
            _ => Ok(Some(EMPTY)),
        }
    }

    /// The ground in grey, darker than what lies over it.
    fn ground_tones(&self) -> Tones {
        let (low, high) = self.data.ground.range_m();
        let high = low + (high - low) * 1.6;
        let scaled = Scaled { low: low as f32, high: high as f32, scale: Scale::Linear };
        Tones { colours: Colours::Grey, scaled, mark_above: None }
    }

    /// The latest samples of the ground that are held.
    fn heights(&self) -> Option<&'a Held> {
        let size = self.data.ground.lattice().size;
        let ids = (0..self.plan.buffers.len()).rev().map(BufferId);
        let is_ground = |id: &BufferId| self.plan.buffer(*id).name == HEIGHT;
        ids.filter(is_ground).filter_map(|id| (self.held)(id)).find(|held| held.size() == (size.x, size.y))
    }

    /// The ground under a list of triangles or blocks, relative to an origin in world metres.
    fn ground(&self, origin_m: DVec3) -> Option<Lattice<'a>> {
        let heights = self.heights()?;
        let (columns, rows) = heights.size();
        let cell_m = self.data.ground.lattice().cell_m.as_vec2().to_array();
        Some(Lattice { heights, size: UVec2::new(columns, rows), cell_m, south_west_m: -origin_m })
    }

    /// The points that a buffer is drawn on, and what colours them.
    fn drawn_on<'b>(
        &self,
        seen: &Seen<'b>,
        form: Form,
        lattice: Option<&'b Lattice<'b>>,
    ) -> Option<(Points<'b>, Colouring<'b>)>
    where
        'a: 'b,
    {
        let Seen { held, channel, source } = *seen;
        if form == Form::Figure {
            return Some((Points::Grid(held), Colouring::One(BRIGHT_LINE)));
        }
        let grid = |vertex: BufferId| (self.held)(vertex).map(Points::Grid);
        match self.plan.known().surface(source?)? {
            Surface::Own(OnMesh::Grid(_)) => Some((Points::Grid(held), Colouring::Points(held, channel))),
            Surface::Own(mesh) => {
                let listed = if matches!(mesh, OnMesh::Blocks(_)) { Listed::Blocks } else { Listed::Triangles };
                Some((Points::Lattice(lattice?, held, listed), Colouring::Points(held, channel)))
            }
            Surface::Points(vertex) => Some((grid(vertex)?, Colouring::Points(held, channel))),
            Surface::Cells(vertex) => Some((grid(vertex)?, Colouring::Cells(held, channel))),
            Surface::UnitSquare { vertex, places } => {
                Some((grid(vertex)?, Colouring::Places(held, channel, (self.held)(places)?)))
            }
            Surface::Map => None,
        }
    }
}

/// Sides of a picture that is not drawn element by element.
const PICTURE: (u32, u32) = (800, 600);

/// A picture of a buffer after a frame, three bytes a pixel: its first look that is one, lowest to highest value, in the usual colours.
pub fn picture(
    gpu: &Gpu,
    executor: &Executor,
    data: &SceneData,
    frame: usize,
    id: BufferId,
) -> Result<(u32, Vec<u8>), Diagnostic> {
    let plan = executor.plan().clone();
    let source = plan.source_of(id);
    let is_picture = |form: &&Form| matches!(form, Form::Image | Form::Figure | Form::Above);
    let forms = plan.known().forms(source);
    let name = &plan.buffer(id).name;
    let form = forms
        .iter()
        .find(is_picture)
        .copied()
        .ok_or_else(|| Diagnostic::input(format!("`{name}` has no picture")).help("`--dump` writes its numbers"))?;
    let ids = plan.outputs.iter().filter(|id| plan.lives(**id));
    let all: BTreeMap<BufferId, Held> = ids.map(|&id| Ok((id, executor.held(id)?))).collect::<Result<_, GpuError>>()?;
    let find = |id: BufferId| all.get(&id);
    let camera = data.cameras()[frame];
    let sight = Sight { plan: &plan, data, camera: &camera, held: &find, other_picture: None };
    let Some(held) = all.get(&id) else { return Err(GpuError::Plan(format!("`{name}` is not held")).into()) };
    let numbers = channels(&held.about);
    let channel = &numbers[usual_channel(&plan, source, form).min(numbers.len() - 1)];
    let part = Part::all(held);
    let statistics = gpu.statistics(&Looked { held, channel, minus: None, part })?;
    let scaled = Scaled::new(statistics.lowest.unwrap_or(0.0), statistics.highest.unwrap_or(1.0), Scale::Linear);
    let tones = Tones { colours: usual_colours(held, channel), scaled, mark_above: None };
    let size = if form == Form::Image { (part.columns, part.rows) } else { PICTURE };
    let canvas = gpu.canvas(size)?;
    match form {
        Form::Image => {
            let (origin, step) = ([0.0; 2], [1.0; 2]);
            gpu.paint_image(&canvas, &Image { held, channel, minus: None, part, origin, step, tones })?;
        }
        _ => {
            let extent = sight.whole(form, part).in_shape(size);
            let through = sight.through(form, &extent, None);
            let style = Style { lines: true, filled: true, tones };
            let seen = Seen { held, channel, source: Some(source) };
            sight.paint(gpu, &canvas, &seen, form, (&extent, &through), &style)?;
        }
    }
    let rgba = canvas.read(gpu)?;
    let rgb = rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    Ok((canvas.size.0, rgb))
}

/// Of the points of a mesh that is seen in space, the level or error; of a list, the level; otherwise the first number.
pub fn usual_channel(plan: &Plan, source: BufferId, form: Form) -> usize {
    match plan.known().surface(source).filter(|_| form.is_in_space()) {
        Some(Surface::Own(OnMesh::Grid(_))) => 3,
        Some(Surface::Own(_)) => {
            channels(plan.buffer(source)).iter().position(|channel| channel.name == LEVEL).unwrap_or(0)
        }
        _ => 0,
    }
}

/// The colours that suit a buffer.
pub fn usual_colours(held: &Held, channel: &Channel) -> Colours {
    match held.about.spread {
        _ if channel.name == LEVEL => Colours::Levels,
        Spread::Samples if held.about.name == HEIGHT => Colours::Grey,
        _ => Colours::Viridis,
    }
}

/// The number of a list's element that tells how coarse it is.
const LEVEL: &str = "level";

impl Extent {
    /// The same and more around it, in the shape of a picture.
    fn in_shape(self, size: (u32, u32)) -> Self {
        let (centre, half) = ((self.low + self.high) / 2.0, (self.high - self.low) / 2.0);
        let size = DVec2::new(size.0.into(), size.1.into());
        let per_pixel = (half / size).max_element();
        Self { low: centre - size * per_pixel, high: centre + size * per_pixel }
    }
}

fn primitives(points: &Points) -> f64 {
    match points {
        Points::Grid(held) => f64::from(held.size().0) * f64::from(held.size().1),
        Points::Lattice(_, held, _) => held.length as f64,
    }
}
