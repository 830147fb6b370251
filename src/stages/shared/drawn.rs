//! The buffers of a picture's distances, which every stage that draws makes alike.

use crate::kernel::Elem;
use crate::plan::{BufferId, Chain};

/// Distances along the pixels' rays in metres, negative where there is no surface.
pub fn make_distance(chain: &mut Chain) -> BufferId {
    let (columns, rows) = chain.data.scene.viewport;
    let id = chain.make("distance", Elem::F32, &[rows, columns], "m", "distance along the pixel's ray");
    chain.set_missing_below_zero(id);
    id
}
