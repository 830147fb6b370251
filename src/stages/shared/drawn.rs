//! The buffers of a picture's distances, which every stage that draws makes alike.

use crate::kernel::Elem;
use crate::plan::{BufferId, Chain, Spread};

/// Distances along the pixels' rays in metres, negative where there is no surface.
pub fn make_distance(chain: &mut Chain) -> BufferId {
    let id = chain.make_over("distance", Elem::F32, Spread::Pixels, "m", "distance along the pixel's ray");
    chain.set_missing_below_zero(id);
    id
}
