mod paper;
mod proven;

use super::{GridError, Rule};
use crate::plan::product::Mesh;
use crate::reference::{Absent, Buffers, Frame, Reference};

impl Reference for GridError {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let Mesh::Grid(grid) = buffers.latest()? else { return Err(Absent("a grid".into())) };
        match self.rule {
            Rule::Paper => paper::reference(frame, buffers, grid, self.threshold_px, true)?,
            Rule::Estimate => paper::reference(frame, buffers, grid, self.threshold_px, false)?,
            Rule::Proven => proven::reference(frame, buffers, grid, self.threshold_px),
        }
        Ok(())
    }
}
