mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::{BufferId, Chain, Spread, StepBuilder};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Warp",
    summary: "separable warp of the grid: points gather where the importance is high",
    formula: "along a row, then down a column: x(s) with F(x(s)) = s F(1), F the running sum of the importance",
    source: "Dachsbacher, Stamminger 2004, section 3.3, Fig. 5; refinement after Loeffler et al. 2009, section 4",
    reads: &["importance", "grid_point"],
    writes: &["warp_rows", "warp_columns", "warp_map", "grid_point"],
    parameters: schema::<Warp>,
    read: read_as::<Warp>,
    examples: &[
        Example::new(
            "[ViewGrid(size: (23, 17)), AspectImportance(size: (21, 17)), Warp(rounds: 2, uniform_share: 0.1)]",
        ),
        Example::new("[ViewGrid(size: (17, 23)), AspectImportance(size: (5, 8)), Warp]")
            .in_benches(&[("ViewGrid.size", "(512, 384)"), ("AspectImportance.size", "(64, 64)")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Warp {
    /// how often rows and columns are warped
    #[schemars(range(min = 1, max = 8))]
    rounds: u32,
    /// share of the points that importance does not move: 0 is none, 1 is all
    #[schemars(range(min = 0, max = 1))]
    uniform_share: f64,
    /// how running sums are made
    sums: Sums,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
enum Sums {
    /// keeps what f32 rounds away
    Compensated,
    /// one f32 a sum
    Plain,
}

impl Default for Warp {
    fn default() -> Self {
        Self { rounds: 1, uniform_share: 0.0, sums: Sums::Compensated }
    }
}

/// The longest row or column of a map of importance: one thread goes over it four times, and an adapter may end the loops of a thread
/// after 65535 turns in all.
const LONGEST_LINE: u32 = 16_000;

impl Stage for Warp {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let importance = chain.read("importance")?;
        let points = chain.read("grid_point")?;
        let grid = chain.grid_size(points, Elem::Vec2F32)?;
        let &[rows, columns] = &chain.buffer(importance).dims[..] else {
            return Err(Diagnostic::input("`Warp` needs `importance` as a map of rows and columns")
                .at(chain.origin(), "this stage"));
        };
        if rows.max(columns) > LONGEST_LINE {
            let message = format!("`importance` has {columns} x {rows} elements, which is too large for a warp");
            return Err(Diagnostic::input(message)
                .at(chain.origin(), "this stage")
                .help(format!("make it with at most {LONGEST_LINE} columns and rows")));
        }
        let importance = chain.read_as("importance", Elem::F32, &[rows, columns])?;
        let size = UVec2::new(columns, rows);
        let mut map = None;
        for round in 0..self.rounds {
            map = Some(self.round(chain, round, importance, (size, grid), map)?);
        }
        let Some((map, share)) = map else { return Ok(()) };
        let meaning = "place in the projector's image, (0, 0) to (1, 1)";
        let warped = chain.make("grid_point", Elem::Vec2F32, &[grid.y, grid.x], "", meaning);
        chain.set_spread(warped, Spread::GridPoints);
        self.step(chain, "refine", self.rounds - 1, (size, grid))?
            .bind("warp_map", map)
            .bind("share", share)
            .bind("uniform_point", points)
            .bind("grid_point", warped)
            .over(grid)
    }
}

impl Warp {
    /// One round of rows and columns; the map so far and how much of it keeps every cell convex.
    fn round(
        &self,
        chain: &mut Chain,
        round: u32,
        importance: BufferId,
        (size, grid): (UVec2, UVec2),
        before: Option<(BufferId, BufferId)>,
    ) -> Result<(BufferId, BufferId), Diagnostic> {
        let (wide, high) = (size.x + 1, size.y + 1);
        let mut weights = importance;
        if let Some((map, _)) = before {
            let meaning = "importance after earlier rounds";
            weights = chain.make("warped_importance", Elem::F32, &[size.y, size.x], "", meaning);
            chain.set_spread(weights, Spread::Projector);
            let resample = self.step(chain, "resample", round, (size, grid))?.bind("importance", importance);
            resample.bind("map_before", map).bind("resampled", weights).over(size)?;
        }
        let rows = chain.make("warp_rows", Elem::F32, &[size.y, wide], "", "where each row's column borders go");
        let columns = chain.make("warp_columns", Elem::F32, &[size.x, high], "", "where each column's row borders go");
        let map = chain.make("warp_map", Elem::Vec2F32, &[high, wide], "", "where the map's corners go");
        [rows, columns].into_iter().for_each(|id| chain.set_spread(id, Spread::Rows));
        chain.set_spread(map, Spread::ProjectorCorners);
        let meaning = "how much of the warp keeps every cell convex, as the bits of an f32";
        let share = chain.make("warp_share", Elem::U32, &[1], "", meaning);
        // rows and columns are walked by one function, of which each needs only half; a row is not made from the rows'
        // warps, and any buffer will do for them
        let walk = self.step(chain, "rows", round, (size, grid))?.bind("importance", weights).bind("rows_out", rows);
        walk.bind("warp_rows", weights).leave_unbound("columns_out").over(UVec2::new(size.y, 1))?;
        let walk =
            self.step(chain, "columns", round, (size, grid))?.bind("importance", weights).bind("columns_out", columns);
        walk.bind("warp_rows", rows).leave_unbound("rows_out").over(UVec2::new(size.x, 1))?;
        let compose =
            self.step(chain, "compose", round, (size, grid))?.bind("warp_rows", rows).bind("warp_columns", columns);
        let compose = match before {
            Some((map, _)) => compose.bind("map_before", map),
            None => compose.leave_unbound("map_before"),
        };
        compose.bind("map_out", map).bind("share_out", share).over(UVec2::new(wide, high))?;
        self.step(chain, "unfold", round, (size, grid))?.bind("warp_map", map).bind("share_out", share).over(size)?;
        Ok((map, share))
    }

    fn step<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        entry: &str,
        round: u32,
        (size, grid): (UVec2, UVec2),
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = chain.kernel("grids/warp.wgsl")?;
        Ok(chain
            .step(&format!("{entry} {}", round + 1), &kernel, entry)
            .constant("COMPENSATED", f64::from(self.sums == Sums::Compensated))
            .constant("HAS_MAP", f64::from(round > 0))
            .set("size", size.to_array())
            .set("grid", grid.to_array())
            .set("uniform_share", self.uniform_share as f32))
    }
}
