mod error;
mod triangles;

use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;

use super::Rasterize;
use crate::plan::product::{Drawn, List, Mesh, MeshLevel};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::traversal::TILE;
use triangles::Triangles;

impl Reference for Rasterize {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let mesh: Mesh<_> = buffers.latest()?;
        let promise = mesh.promise();
        let triangles = match mesh {
            Mesh::List(List { triangle, count, .. }) => {
                let casts_beside = promise.is_some_and(|promise| promise.proven);
                Triangles::of_list(frame, &buffers.values(triangle), &buffers.values(count), casts_beside)
            }
            Mesh::Grid(grid) => {
                let bounds = grid.cell_bound.map(|id| buffers.values(id));
                Triangles::of_grid(frame, &buffers.values(grid.vertex), bounds.as_deref())
            }
        };
        // how far a grid was raised is known to an interval only: what it covers then hangs on that
        let is_loose = triangles.is_proven() && triangles.bounds_m.iter().any(|&bound_m| bound_m > 1e-3);
        // what is drawn of a list has no error of its own
        let is_grid = matches!(mesh, Mesh::Grid(_));
        let threshold_px = promise.filter(|_| is_grid).map(|promise| promise.told_px(frame.data));
        let carries_level = is_grid && promise.is_none() && frame.ground.detail().is_some();
        let (width_px, height_px) = frame.camera.viewport;
        let sky = Sky { frame, clear_until: buffers.get("clear_until").ok() };
        let seen = |y: u32, x: u32| {
            let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            if triangles.is_open {
                return ((f64::NAN, f64::INFINITY), (f64::NAN, 0.0));
            }
            let hit = triangles.seen(frame, pixel);
            if carries_level {
                return triangles.interpolated(frame, pixel, &hit);
            }
            let Some(threshold_px) = threshold_px else { return (hit.distance, (f64::NAN, 0.0)) };
            if is_loose {
                return ((f64::NAN, f64::INFINITY), (f64::NAN, f64::INFINITY));
            }
            if hit.triangle.is_none() && triangles.is_proven() {
                return (hit.distance, sky.error(x, y, hit.distance.1));
            }
            triangles.error(frame, pixel, &hit, threshold_px)
        };
        let pixels: Vec<((f64, f64), (f64, f64))> = (0..height_px)
            .into_par_iter()
            .flat_map_iter(|y| (0..width_px).map(move |x| (y, x)))
            .map(|(y, x)| seen(y, x))
            .collect();
        let mut distance = Values::missing(&[height_px, width_px], 1);
        let mut carried = Values::missing(&[height_px, width_px], 1);
        for (at, ((value, bound), (own, own_bound))) in pixels.into_iter().enumerate() {
            distance.set(at, value, bound);
            carried.set(at, own, own_bound);
        }
        let distance = buffers.put("distance", distance);
        if carries_level {
            let level = buffers.put("mesh_level", carried);
            buffers.offer(MeshLevel { level, distance });
            buffers.offer(Drawn { distance, error: None, mesh: Some(mesh), promise });
            return Ok(());
        }
        let error = threshold_px.map(|_| buffers.put("error", carried));
        buffers.offer(Drawn { distance, error, mesh: Some(mesh), promise });
        Ok(())
    }
}

/// What is known of the pixels that a proven mesh does not cover: whether the rays of their tile meet nothing.
struct Sky<'a> {
    frame: &'a Frame<'a>,
    clear_until: Option<Arc<Values>>,
}

impl Sky<'_> {
    /// The error of a pixel without a triangle, with its bound.
    fn error(&self, x: u32, y: u32, bound: f64) -> (f64, f64) {
        let tile = (y / TILE * self.frame.camera.viewport.0.div_ceil(TILE) + x / TILE) as usize;
        let led = self.clear_until.as_ref().filter(|_| !self.frame.sees_underside());
        let is_sky = led.is_some_and(|clear| clear.value[tile] > 1e38);
        let is_unknown = led.is_some_and(|clear| clear.bound[tile] > 0.0);
        let open = if bound.is_infinite() || is_unknown { f64::INFINITY } else { f64::MIN_POSITIVE };
        (f64::from(!is_sky), open)
    }
}
