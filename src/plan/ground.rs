//! What a plan knows of the ground: which buffers stand behind the functions that kernels include, and whose ground it is.

use std::sync::Arc;

use super::product::{Blocks, Mesh, NodeRanges};
use super::{BufferId, Chain, Storage};
use crate::experiment::diagnostic::{Diagnostic, Origin};
use crate::experiment::scene::{Held, Surface};
use crate::ground::octaves::Octaves;
use crate::ground::{Detailed, Lattice};
use crate::kernel::{Elem, GroundForm, Kernel};

/// Bytes that every adapter binds as one array.
pub const ANY_ADAPTER_BINDS: u64 = 128 << 20;

impl Chain<'_> {
    pub fn lattice(&self) -> Lattice {
        self.data.ground.lattice()
    }

    /// The ground is that of the scene, and not one that a kernel has made.
    pub fn is_scene_ground(&self) -> bool {
        self.buffer(self.ground).storage == Storage::Input
    }

    /// Every height is the same, as far as can be known beforehand.
    pub fn is_flat(&self) -> bool {
        self.is_scene_ground() && self.data.ground.is_flat()
    }

    /// The octaves over the surface, if the scene has some.
    pub fn octaves(&self) -> Option<&Octaves> {
        self.data.ground.detail().map(Detailed::octaves)
    }

    /// For a stage that relies on heights between samples being no more than what is between them.
    pub fn check_no_octaves(&self, relies: &str) -> Result<(), Diagnostic> {
        match self.octaves() {
            None => Ok(()),
            Some(octaves) => Err(self
                .refusal(&format!(
                    "{relies}, and the scene's octaves add up to {:.4} m between samples",
                    octaves.most_m()
                ))
                .help("take `detail` out of the scene, or set `scene.detail.octaves` to 0")),
        }
    }

    /// An eye can be under the surface or beyond the border. Where a kernel has moved the ground, nobody knows.
    pub fn sees_underside(&self) -> bool {
        self.data.sees_underside || !self.is_scene_ground()
    }

    /// For a stage that relies on what is known of the scene's ground: its highest, its steepest.
    pub fn check_scene_ground(&self) -> Result<(), Diagnostic> {
        self.check_no_octaves("relies on what samples say of the ground between them")?;
        match self.is_scene_ground() {
            true => Ok(()),
            false => Err(self.refusal("relies on the scene's own ground, and a kernel has made another one").help(
                "use the rule that promises nothing, or make the heights a terrain of their own (`--dump height`)",
            )),
        }
    }

    /// For a stage that promises a bound: rounding in f32 may have half of it.
    pub fn check_bound(&self, bound_px: f64) -> Result<(), Diagnostic> {
        let rounding_px = self.data.rounding_px();
        if rounding_px <= 0.5 * bound_px {
            return Ok(());
        }
        let steepest = self.data.ground.steepest_seen();
        Err(self.refusal(&format!(
            "promises {bound_px} px, and rounding in f32 can move what a ray meets by {rounding_px:.2e} px with these cameras: \
             the ground rises by up to {steepest:.3e} m in a metre"
        ))
        .help(format!("here, {:.2e} px and more can be promised", 2.0 * rounding_px)))
    }

    /// A kernel of this crate, with the ground in the form in which it is held.
    pub fn kernel(&self, path: &str) -> Result<Arc<Kernel>, Diagnostic> {
        Kernel::built_in(path, self.ground_form())
    }

    /// The form in which kernels find the ground; `None` leaves it to each kernel.
    pub fn ground_form(&self) -> Option<GroundForm> {
        if !self.is_scene_ground() {
            return Some(GroundForm::Array);
        }
        match self.data.scene.held_as {
            Held::Array => Some(GroundForm::Array),
            Held::Image => Some(GroundForm::Image),
            Held::Auto => (self.buffer(self.ground).bytes() > ANY_ADAPTER_BINDS).then_some(GroundForm::Image),
        }
    }

    /// Makes a buffer the ground of the stages after this one.
    pub fn change_ground(&mut self, heights: BufferId) -> Result<(), Diagnostic> {
        self.check_no_octaves("makes another ground of samples")?;
        let size = self.lattice().size;
        let kind = self.check_kind(heights, Elem::F32, &[size.y, size.x]);
        kind.map_err(|error| error.help("a new `height` is the ground of the stages after it"))?;
        let promised =
            self.products().find(|mesh: &Mesh<BufferId>| mesh.promise().is_some_and(|promise| promise.proven));
        let split = self.products().find(|blocks: &Blocks<BufferId>| blocks.promise.proven);
        if promised.is_some() || split.is_some() {
            return Err(self
                .refusal("changes the ground after a stage has promised a bound on it")
                .help("put it in front of that stage, and let that stage promise nothing"));
        }
        self.ground = heights;
        Ok(())
    }

    /// Like [`Chain::read_as`], for what says something of the ground: it has to be of the ground that there is now.
    pub fn read_of_ground(&self, name: &str, elem: Elem, dims: &[u32]) -> Result<BufferId, Diagnostic> {
        let id = self.read_as(name, elem, dims)?;
        self.check_of_ground(id).map(|()| id)
    }

    /// Refuses what was made before the ground was changed.
    fn check_of_ground(&self, id: BufferId) -> Result<(), Diagnostic> {
        if id > self.ground || self.is_scene_ground() {
            return Ok(());
        }
        let message = format!("needs `{}` of the ground that a kernel has made since", self.buffer(id).name);
        Err(self.refusal(&message).help("move the stage that makes it behind the kernel that changes the ground"))
    }

    /// The buffer behind a variable of `kernels/ground/`.
    pub(super) fn ground_buffer(&self, variable: &str, declared: &Origin) -> Result<BufferId, Diagnostic> {
        if variable == "ground_samples" || variable == "ground_image" {
            return Ok(self.ground);
        }
        let ranges: NodeRanges<BufferId> = self.latest()?;
        let id = match variable {
            "ground_max" => ranges.highest,
            "ground_min" => ranges.lowest,
            _ => return Err(Diagnostic::run(format!("nothing fills `{variable}`")).at(declared, "declared here")),
        };
        let layout = self.lattice().cells();
        self.check_kind(id, Elem::F32, &layout.dims())?;
        self.check_of_ground(id)?;
        Ok(id)
    }

    /// The constants that `kernels/ground/surface.wgsl` asks for.
    pub(super) fn ground_constants(&self, kernel: &Kernel) -> Vec<(String, f64)> {
        if kernel.assembled.ground.is_none() {
            return Vec::new();
        }
        let lattice = self.lattice();
        let (cells, means) = (lattice.cells(), lattice.means());
        let mut constants: Vec<(String, f64)> = [
            ("COLUMNS", lattice.size.x.into()),
            ("ROWS", lattice.size.y.into()),
            ("CELLS_STRIDE", cells.stride.into()),
            ("CELLS_TALL_POW2", cells.tall_pow2.into()),
            ("CELLS_TOP", cells.top.into()),
            ("MEANS_STRIDE", means.stride.into()),
            ("MEANS_TALL_POW2", means.tall_pow2.into()),
            ("MEANS_TOP", means.top.into()),
        ]
        .map(|(name, value)| (format!("{GROUND_CONSTANT}{name}"), value))
        .into();
        // the kernel's own default is triangles
        if self.data.scene.surface == Surface::Bilinear {
            constants.push(("BILINEAR".to_string(), 1.0));
        }
        if self.octaves().is_some() {
            constants.push(("OCTAVES".to_string(), 1.0));
        }
        constants
    }
}

/// What the names of constants begin with that say where the ground's samples are: they are the same for all kernels of a plan.
pub const GROUND_CONSTANT: &str = "GROUND_";
