use glam::{DVec2, UVec2};
use serde::Deserialize;

use super::projector::Projector;
use super::{EPSILON, Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "AspectImportance",
    summary: "importance of the cells of a coarse grid on the view plane: how stretched they are on the base plane",
    formula: "importance = length along the view / width across it, of the projected cell",
    source: "Loeffler et al. 2009, section 4 (grid definition): the inverse of their aspect ratio",
    reads: &[],
    writes: &["importance"],
    kernels: &["aspect_importance.wgsl"],
    params: &[("size", "(64, 64)", "columns and rows of cells, 1 to 8192 each")],
    read: |node, _| {
        let stage: AspectImportance = node.parse_fields()?;
        let (columns, rows) = stage.size;
        if !(1..=8192).contains(&columns) || !(1..=8192).contains(&rows) {
            let size = node.field("size").unwrap_or(node);
            return Err(Diagnostic::input(format!("an importance map of {columns} x {rows} cells"))
                .at(&size.origin, "each side is from 1 to 8192 cells"));
        }
        Ok(Box::new(stage))
    },
};

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AspectImportance {
    size: (u32, u32),
}

impl Default for AspectImportance {
    fn default() -> Self {
        Self { size: (64, 64) }
    }
}

impl Stage for AspectImportance {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (columns, rows) = self.size;
        let importance =
            chain.make("importance", Elem::F32, &[rows, columns], "", "length over width of the projected cell");
        let kernel = Kernel::built_in("aspect_importance.wgsl")?;
        chain
            .step("importance", &kernel, "main")
            .bind("importance", importance)
            .set_projector()
            .set("size", [columns, rows])
            .over(UVec2::from(self.size))
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let (columns, rows) = self.size;
        let projector = Projector::new(frame.data, frame.camera);
        let corner = |x: u32, y: u32| {
            let uv = DVec2::new(f64::from(x) / f64::from(columns), f64::from(y) / f64::from(rows));
            projector.ground_off_m(uv, 10.0 * EPSILON)
        };
        let mut importance = Values::missing(&[rows, columns], 1);
        for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            let corners = [corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1)];
            let [nw, ne, sw, se] = corners.map(|(place, _)| place);
            let off_m = corners.iter().map(|(_, off)| *off).fold(0.0, f64::max);
            let width = ne.distance(nw) + se.distance(sw);
            let tall = sw.distance(nw) + se.distance(ne);
            let value = (tall / width.max(1e-30)).clamp(1e-6, 1e6);
            // each sum of two distances is off by what four corners are off by
            let share = 4.0 * off_m / width.max(1e-30);
            let bound = (share + value * share) / (1.0 - share).max(1e-9) + 16.0 * EPSILON * value;
            // where rounding is as large as a cell, nothing can be said
            importance.set((y * columns + x) as usize, value, if share < 0.5 { bound } else { f64::INFINITY });
        }
        buffers.put("importance", importance);
    }
}
