mod reference;

use glam::UVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product::{Warped, what};
use crate::plan::{BufferId, Chain, Spread, StepBuilder};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Warp",
    summary: "separable warp of the grid: points gather where the importance is high",
    formula: "along a row, then down a column: x(s) with F(x(s)) = s F(1), F the running sum of the importance",
    source: "Dachsbacher, Stamminger 2004, section 3.3, Fig. 5; refinement after Loeffler et al. 2009, section 4",
    reads: &["importance", "grid_point"],
    writes: &["warp_rows", "warp_columns", "warp_map", "warp_gave_way", "warp_residual", "grid_point"],
    offers: &[what::<Warped<()>>()],
    parameters: schema::<Warp>,
    read: read_as::<Warp>,
    examples: &[
        Example::new(
            "[ViewGrid(size: (23, 17)), AspectImportance(size: (21, 17)), Warp(rounds: 2, least_gain: 0, uniform_share: 0.1)]",
        ),
        Example::new(
            "[ViewGrid(size: (19, 21)), AspectImportance(size: (9, 12)), Warp(rounds: 2, least_gain: 0, lead: 0)]",
        )
        .in_benches(&[("ViewGrid.size", "(512, 384)"), ("AspectImportance.size", "(64, 64)")]),
        Example::new("[ViewGrid(size: (12, 14)), AspectImportance(size: (11, 13)), Warp(rounds: 2)]")
            .in_benches(&[("ViewGrid.size", "(512, 384)"), ("AspectImportance.size", "(64, 64)")]),
        Example::new("[ViewGrid(size: (17, 23)), AspectImportance(size: (5, 8)), Warp]")
            .in_benches(&[("ViewGrid.size", "(512, 384)"), ("AspectImportance.size", "(64, 64)")]),
    ],
    ..Info::EMPTY
};

/// How often the corners of cells that are folded give way in a round; an even number.
const RELAXATIONS: usize = 8;

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Warp {
    /// how often rows and columns are warped; each further round gives what the rounds before have left missing
    #[schemars(range(min = 1, max = 8))]
    rounds: u32,
    /// a further round begins only if the one before has lowered the spread of what is missing by at least this share, and if it is spread
    /// by more than a tenth of an octave (root of the variances of the logarithms along rows and down columns, by demand); 0 is always
    #[schemars(range(min = 0, max = 1))]
    least_gain: f64,
    /// share of the points that importance does not move: 0 is none, 1 is all
    #[schemars(range(min = 0, max = 1))]
    uniform_share: f64,
    /// how far a row is led by the more important ones beside it, and a column, as a share of the map: what differs too much from one row to
    /// the next folds the cells between them; 0 is not at all, as in the paper
    #[schemars(range(min = 0, max = 1))]
    lead: f64,
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
        Self { rounds: 1, least_gain: 0.02, uniform_share: 0.0, lead: 0.1, sums: Sums::Compensated }
    }
}

/// The longest row or column of a map of importance: one thread goes over it five times, once more beside one that is empty, and an adapter
/// may end the loops of a thread after 65535 turns in all.
const LONGEST_LINE: u32 = 10_900;

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
        let work = GridWork::new(chain);
        let begin = self.folds(chain, "begin_grid", 0, (size, grid))?.bind("grid_work", work.cells);
        begin.bind("left_work", work.folded).over(UVec2::ONE)?;
        let mut last = None;
        for round in 0..self.rounds {
            last = Some(self.round(chain, round, importance, (size, grid), last, &work)?);
        }
        let Some(Round { map, gave_way }) = last else { return Ok(()) };
        chain.offer(Warped { gave_way, share: work.cells });
        let step = self.folds(chain, "find_grid_folds", self.rounds - 1, (size, grid))?.bind("warp_map", map);
        step.bind("uniform_point", points).bind("left_work", work.folded).over_indirect(work.cells)?;
        let step = self.folds(chain, "unfold", self.rounds - 1, (size, grid))?.bind("warp_map", map);
        step.bind("uniform_point", points).bind("grid_work", work.cells).over_indirect(work.folded)?;
        let meaning = "place in the square that the grid is over, (0, 0) to (1, 1)";
        let warped = chain.make("grid_point", Elem::Vec2F32, &[grid.y, grid.x], "", meaning);
        chain.set_spread(warped, Spread::GridPoints);
        self.step(chain, "refine", self.rounds - 1, (size, grid))?
            .bind("warp_map", map)
            .bind("share", work.cells)
            .bind("uniform_point", points)
            .bind("grid_point", warped)
            .over(grid)
    }
}

impl Warp {
    /// One round of rows and columns: the map so far.
    fn round(
        &self,
        chain: &mut Chain,
        round: u32,
        importance: BufferId,
        (size, grid): (UVec2, UVec2),
        before: Option<Round>,
        work: &GridWork,
    ) -> Result<Round, Diagnostic> {
        let (wide, high) = (size.x + 1, size.y + 1);
        let (mut along, mut down) = (importance, importance);
        if let Some(Round { map, .. }) = before {
            let meaning = "importance that earlier rounds have left, ";
            let mut make = |name, way| {
                let id = chain.make(name, Elem::F32, &[size.y, size.x], "", &format!("{meaning}{way}"));
                chain.set_spread(id, Spread::UnitSquare);
                id
            };
            (along, down) = (make("missing_along", "along rows"), make("missing_down", "down columns"));
            let resample = self.step(chain, "resample", round, (size, grid))?.bind("importance", importance);
            resample.bind("map_before", map).bind("along_out", along).bind("down_out", down).over(size)?;
        }
        let [rows, columns] = [("warp_rows", size.y, wide, "column"), ("warp_columns", size.x, high, "row")].map(
            |(name, lines, borders, of)| {
                let meaning = format!("where each line's {of} borders go; anything, if the last round was not needed");
                chain.make(name, Elem::F32, &[lines, borders], "", &meaning)
            },
        );
        let map = make_map(chain, "warp_map", size);
        [rows, columns].into_iter().for_each(|id| chain.set_spread(id, Spread::Rows));
        let gave_way = self.gave_way(chain, size);
        let [folds, back] = ["fold_work", "back_work"]
            .map(|name| chain.make(name, Elem::U32, &[3], "", "workgroups along x, y, z that look after folds"));
        let begin = self.folds(chain, "begin", round, (size, grid))?.bind("fold_work", folds);
        begin.bind("back_work", back).over(UVec2::ONE)?;
        let needed = if round > 0 { self.judge(chain, round, (size, grid), (along, down))? } else { None };
        self.walk(chain, (round, size, grid), (along, down), (rows, columns), needed)?;
        let compose =
            self.step(chain, "compose", round, (size, grid))?.bind("warp_rows", rows).bind("warp_columns", columns);
        let compose = compose.bind_or_leave("map_before", before.map(|before| before.map));
        let compose = compose.bind_or_leave("gave_way_before", before.map(|before| before.gave_way));
        let compose = compose.bind("map_out", map).bind("gave_way", gave_way);
        compose.bind_or_leave("round_needed", needed).over(UVec2::new(wide, high))?;
        let find = self.folds(chain, "find_folds", round, (size, grid))?.bind("warp_map", map);
        let find = find.bind("fold_work", folds).bind("grid_work", work.cells);
        find.bind_or_leave("round_needed", needed).over(size)?;
        self.give_way(chain, round, (size, grid), [map, folds, gave_way])?;
        if let Some(before) = before {
            let find = self.folds(chain, "find_left", round, (size, grid))?.bind("warp_map", map);
            find.bind("back_work", back).over_indirect(folds)?;
            let take_back = self.folds(chain, "take_back", round, (size, grid))?.bind("map_before", before.map);
            let take_back = take_back.bind("map_out", map).bind("gave_way_before", before.gave_way);
            take_back.bind("gave_way", gave_way).over_indirect(back)?;
        }
        Ok(Round { map, gave_way })
    }

    /// Where the borders of rows and of columns go.
    fn walk(
        &self,
        chain: &mut Chain,
        (round, size, grid): (u32, UVec2, UVec2),
        (along, down): (BufferId, BufferId),
        (rows, columns): (BufferId, BufferId),
        needed: Option<BufferId>,
    ) -> Result<(), Diagnostic> {
        // both are walked by one function, of which each needs only half; a row is not made from the rows' warps, and any buffer will do for them
        let (walked, masses) = self.walked(chain, "rows", rows);
        let walk = self.step(chain, "rows", round, (size, grid))?.bind("importance", along).bind("rows_out", walked);
        let walk = walk.bind("warp_rows", along).leave_unbound("columns_out").bind_or_leave("masses_out", masses);
        over_lines(walk, needed, size.y)?;
        self.lead(chain, "rows", (round, size, grid), (walked, rows), (masses, needed))?;
        let (walked, masses) = self.walked(chain, "columns", columns);
        let walk = self.step(chain, "columns", round, (size, grid))?.bind("importance", down);
        let walk = walk.bind("warp_rows", rows).bind("columns_out", walked).leave_unbound("rows_out");
        over_lines(walk.bind_or_leave("masses_out", masses), needed, size.x)?;
        self.lead(chain, "columns", (round, size, grid), (walked, columns), (masses, needed))
    }

    /// Where the warps of lines go before they are led, and how much each of them leads; the warps themselves, if nothing is led.
    fn walked(&self, chain: &mut Chain, lines: &str, led: BufferId) -> (BufferId, Option<BufferId>) {
        if self.lead == 0.0 {
            return (led, None);
        }
        let (count, borders) = (chain.buffer(led).dims[0], chain.buffer(led).dims[1]);
        let meaning = "where borders go before their lines are led by others";
        let walked = chain.make(&format!("unled_{lines}"), Elem::F32, &[count, borders], "", meaning);
        let meaning = "the largest weight of each line, and the sum of the squares of all as shares of it";
        let masses = chain.make(&format!("masses_of_{lines}"), Elem::Vec2F32, &[count], "", meaning);
        chain.set_spread(walked, Spread::Rows);
        (walked, Some(masses))
    }

    /// Lets lines be led by those beside them.
    fn lead(
        &self,
        chain: &mut Chain,
        lines: &str,
        (round, size, grid): (u32, UVec2, UVec2),
        (walked, led): (BufferId, BufferId),
        (masses, needed): (Option<BufferId>, Option<BufferId>),
    ) -> Result<(), Diagnostic> {
        let Some(masses) = masses else { return Ok(()) };
        let (count, borders) = (chain.buffer(led).dims[0], chain.buffer(led).dims[1]);
        let meaning = "how much each line leads, and one over how much it is led";
        let leads = chain.make(&format!("leads_of_{lines}"), Elem::Vec2F32, &[count], "", meaning);
        let weigh = self.step(chain, &format!("weigh_{lines}"), round, (size, grid))?.bind("line_masses", masses);
        over_lines(weigh.bind("leads_out", leads), needed, count)?;
        let lead = self.step(chain, &format!("lead_{lines}"), round, (size, grid))?.bind("line_leads", leads);
        over_lines(lead.bind("unled", walked).bind("led", led), needed, borders)
    }

    /// Finds out whether a round is needed: the workgroups that go over its lines.
    fn judge(
        &self,
        chain: &mut Chain,
        round: u32,
        (size, grid): (UVec2, UVec2),
        (along, down): (BufferId, BufferId),
    ) -> Result<Option<BufferId>, Diagnostic> {
        if self.least_gain == 0.0 {
            return Ok(None);
        }
        let meaning = "after each round but the last, by how much what is missing is spread, in octaves";
        let residual = match chain.find("warp_residual") {
            Some(residual) if round > 1 => residual,
            _ => chain.make("warp_residual", Elem::F32, &[self.rounds - 1], "", meaning),
        };
        let surveys = chain.make(
            "row_survey",
            Elem::F32,
            &[size.y, SURVEYED],
            "",
            "of what is missing in each row: the largest, demand, means, squares",
        );
        let work = chain.make("round_work", Elem::U32, &[3], "", "workgroups along x, y, z that walk lines");
        let survey = self.step(chain, "survey", round, (size, grid))?.bind("missing_along", along);
        survey.bind("missing_down", down).bind("survey_out", surveys).over(UVec2::new(size.y, 1))?;
        let judge = self.step(chain, "judge", round, (size, grid))?.bind("surveys", surveys);
        judge.bind("round_work", work).bind("residual", residual).over(UVec2::ONE)?;
        Ok(Some(work))
    }

    /// How much less a line counts for the next one than for itself.
    fn decay(&self, lines: u32) -> f32 {
        (-1.0 / (self.lead * f64::from(lines))).exp() as f32
    }

    /// How often each corner of the map gives way.
    fn gave_way(&self, chain: &mut Chain, size: UVec2) -> BufferId {
        let meaning = "how often each corner of the map gave way to a fold, in all rounds that were kept";
        let gave_way = chain.make("warp_gave_way", Elem::U32, &[size.y + 1, size.x + 1], "", meaning);
        chain.set_spread(gave_way, Spread::UnitSquareCorners);
        gave_way
    }

    /// Lets the corners of folded cells give way, if there are any.
    fn give_way(
        &self,
        chain: &mut Chain,
        round: u32,
        (size, grid): (UVec2, UVec2),
        [map, work, gave_way]: [BufferId; 3],
    ) -> Result<(), Diagnostic> {
        let other = make_map(chain, "relaxed_map", size);
        // the last one leaves the map where it was, and none of them begins without a fold
        for (from, to) in [(map, other), (other, map)].into_iter().cycle().take(RELAXATIONS) {
            let relax = self.folds(chain, "relax", round, (size, grid))?.bind("relax_from", from).bind("map_out", to);
            relax.bind("gave_way", gave_way).over_indirect(work)?;
        }
        Ok(())
    }

    /// A step that does something about folds.
    fn folds<'c, 'a>(
        &self,
        chain: &'c mut Chain<'a>,
        entry: &str,
        round: u32,
        (size, grid): (UVec2, UVec2),
    ) -> Result<StepBuilder<'c, 'a>, Diagnostic> {
        let kernel = chain.kernel("grids/warp_folds.wgsl")?;
        let step = chain.step(&format!("{entry} {}", round + 1), &kernel, entry);
        let step = step.constant("MAY_END", f64::from(round > 0 && self.least_gain > 0.0));
        Ok(step.set("size", size.to_array()).set("grid", grid.to_array()))
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
            .constant("LED", f64::from(self.lead > 0.0))
            .constant("MAY_END", f64::from(round > 0 && self.least_gain > 0.0))
            .set("size", size.to_array())
            .set("grid", grid.to_array())
            .set("uniform_share", self.uniform_share as f32)
            .set("round", round)
            .set("nothing", 0u32)
            .set("least_gain", self.least_gain as f32)
            // (a row counts for those over and under it)
            .set("decay", [self.decay(size.y), self.decay(size.x)]))
    }
}

/// Numbers that are left for each row; `SURVEYED` of the kernel.
const SURVEYED: u32 = 5;

/// A thread for each line, or none if a round is not needed.
fn over_lines(step: StepBuilder, needed: Option<BufferId>, lines: u32) -> Result<(), Diagnostic> {
    match needed {
        Some(work) => step.over_indirect(work),
        None => step.over(UVec2::new(lines, 1)),
    }
}

/// What is done about folds.
struct GridWork {
    /// Workgroups that look at its cells, if a round has folded anything, and how much of the warp keeps all of them convex.
    cells: BufferId,
    /// The same, if any of them is folded.
    folded: BufferId,
}

/// What a round leaves.
#[derive(Clone, Copy)]
struct Round {
    map: BufferId,
    /// How often each of its corners gave way, in this round and before.
    gave_way: BufferId,
}

impl GridWork {
    fn new(chain: &mut Chain) -> Self {
        let work = "workgroups along x, y, z that look after folds of the grid";
        let meaning = format!("{work}; how much of the warp keeps every cell convex, as the bits of an f32");
        let cells = chain.make("grid_work", Elem::U32, &[4], "", &meaning);
        Self { cells, folded: chain.make("left_work", Elem::U32, &[3], "", work) }
    }
}

fn make_map(chain: &mut Chain, name: &str, size: UVec2) -> BufferId {
    let map = chain.make(name, Elem::Vec2F32, &[size.y + 1, size.x + 1], "", "where the map's corners go");
    chain.set_spread(map, Spread::UnitSquareCorners);
    map
}
