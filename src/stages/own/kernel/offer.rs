//! What a user's kernel makes for stages and measures: a product, said to be one and checked.

use serde::Deserialize;

use super::{Attached, Kernel, New};
use crate::experiment::diagnostic::Diagnostic;
use crate::kernel::{Elem, Packing};
use crate::plan::product::{Drawn, Grid, Mesh, Picture};
use crate::plan::{BufferId, Chain};
use crate::scene::HEIGHT;

/// What a new buffer is offered as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Offered {
    /// Metres along each pixel's ray, negative for sky: a surface as the pixels show it.
    Distance,
    /// A picture, red in the lowest byte of each pixel.
    Colour,
    /// The normalised error of each pixel of what was drawn before.
    Error,
    /// Vertices of a grid: x, y, z in metres from the eye.
    Grid,
}

/// Names that stages give to what they offer.
const USUAL: [(&str, Offered); 4] = [
    ("distance", Offered::Distance),
    ("colour", Offered::Colour),
    ("error", Offered::Error),
    ("vertex", Offered::Grid),
];

impl New {
    /// What it is offered as; a name that says one thing while nothing is said is a mistake.
    fn offered(&self) -> Result<Option<Offered>, Diagnostic> {
        match (self.offered_as, USUAL.iter().find(|(name, _)| *name == self.name)) {
            (None, Some((name, usual))) => Err(Diagnostic::input(format!(
                "`{name}` is what stages call a buffer that others use, and this one is not offered to them"
            ))
            .help(format!("add `as: {usual:?}`, or give it another name"))),
            (offered, _) => Ok(offered),
        }
    }

    /// Refuses a buffer that is not what it is offered as.
    pub fn check(&self, chain: &Chain, id: BufferId) -> Result<(), Diagnostic> {
        if self.name.contains('@') {
            return Err(Diagnostic::input(format!("`{}` cannot be the name of a buffer", self.name))
                .help("`@` stands between a buffer and a step in `--dump`"));
        }
        let (columns, rows) = chain.data.scene.viewport;
        let Some(offered) = self.offered()? else { return Ok(()) };
        let checked = match offered {
            Offered::Distance | Offered::Error => chain.check_kind(id, Elem::F32, &[rows, columns]),
            Offered::Colour => chain.check_kind(id, Elem::U32, &[rows, columns]),
            Offered::Grid => chain.grid_size(id, Elem::Vec4F32).map(|_| ()),
        };
        let said = |error: &Diagnostic| format!("`{}` is offered as `{offered:?}`: {}", self.name, error.message);
        checked.map_err(|error| Diagnostic { message: said(&error), ..error })
    }
}

impl Kernel {
    /// Offers the new buffers that are said to be products.
    pub(super) fn offer(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        for (_, attached, _) in &self.bind {
            let Attached::New(new) = attached else { continue };
            if new.name == HEIGHT {
                let Some(id) = chain.find(HEIGHT) else { continue };
                chain.change_ground(id)?;
            }
            let (Some(offered), Some(id)) = (new.offered()?, chain.find(&new.name)) else { continue };
            match offered {
                Offered::Distance => {
                    chain.set_missing_below_zero(id);
                    chain.offer(Drawn { distance: id, error: None, mesh: None, promise: None });
                }
                Offered::Colour => {
                    chain.set_packing(id, Packing::Bytes);
                    chain.offer(Picture { pixels: id });
                }
                Offered::Error => {
                    let drawn: Drawn<BufferId> = chain.latest()?;
                    chain.offer(Drawn { error: Some(id), ..drawn });
                }
                Offered::Grid => chain.offer(Mesh::Grid(Grid { vertex: id, cell_bound: None, promise: None })),
            }
        }
        Ok(())
    }
}
