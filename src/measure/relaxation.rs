//! A grid of springs over an importance, which a fast warp is compared with (Sloan, Weinstein, Brederson 1998).

use glam::DVec2;

use super::density::{Grid, Importance};

/// The grid after so many passes over its points: each goes to where its springs to its four neighbours hold it in balance, a spring being
/// as stiff as its middle is important, so that in balance it is as long as a cell is wanted there. Points of the border stay on it. With
/// stiffnesses above zero, no cell folds (Tutte 1963).
pub fn relaxed(grid: &Grid, importance: &Importance, passes: u32) -> Grid {
    let mut grid = grid.clone();
    let Some((first, last)) = grid.at_m.first().copied().zip(grid.at_m.last().copied()) else { return grid };
    let sides_m = last - first;
    for _ in 0..passes {
        for y in 0..grid.size.y {
            for x in 0..grid.size.x {
                let place = balanced(&grid, importance, (x, y));
                let at = grid.index(x, y);
                grid.places[at] = place;
            }
        }
    }
    grid.at_m = grid.places.iter().map(|place| first + *place * sides_m).collect();
    grid
}

fn balanced(grid: &Grid, importance: &Importance, (x, y): (u32, u32)) -> DVec2 {
    let here = grid.places[grid.index(x, y)];
    let pull = |x: u32, y: u32| {
        let there = grid.places[grid.index(x, y)];
        let stiff = importance.at(0.5 * (here + there)).max(1e-30);
        (there * stiff, stiff)
    };
    let sum = |pulls: [(DVec2, f64); 2]| pulls.into_iter().fold((DVec2::ZERO, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let is_inside = (x > 0 && x + 1 < grid.size.x, y > 0 && y + 1 < grid.size.y);
    let along = || sum([pull(x - 1, y), pull(x + 1, y)]);
    let down = || sum([pull(x, y - 1), pull(x, y + 1)]);
    match is_inside {
        (true, true) => {
            let (along, down) = (along(), down());
            (along.0 + down.0) / (along.1 + down.1)
        }
        (true, false) => DVec2::new(along().0.x / along().1, here.y),
        (false, true) => DVec2::new(here.x, down().0.y / down().1),
        (false, false) => here,
    }
}
