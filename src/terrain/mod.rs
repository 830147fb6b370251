//! Height sources: procedural noise, exact shapes, elevation files; all become a [`HeightField`].

mod files;
mod geotiff;
mod nodata;
mod noise;
mod npy;
mod on_ground;
mod shapes;

use std::path::Path;

use glam::{DVec2, UVec2};
use thiserror::Error;

use crate::experiment::scene::{Dem, Terrain};

pub use on_ground::{ColourMap, TypeMap};

/// Samples a side of the largest terrain that is held in memory (16 384^2 f32 samples are 1 GiB).
pub const LARGEST_SIDE: u32 = 16_384;

/// A rectangle of height samples. Row 0 is north; the south-west sample is at world (0, 0).
#[derive(Clone, Debug)]
pub struct HeightField {
    /// Columns and rows of samples.
    pub size: UVec2,
    /// Metres between samples along x and y.
    pub cell_m: DVec2,
    /// `[rows, cols]`, metres.
    pub heights_m: Vec<f32>,
}

#[derive(Debug, Error)]
pub enum TerrainError {
    #[error("cannot read `{path}`: {why}")]
    Unreadable { path: String, why: String },
    #[error("`{path}` {what}")]
    BadFile { path: String, what: String },
    #[error("`{0}` is not a kind of elevation file that is known: .png, .tif, .tiff, .hgt, .hgt.zip, .npy")]
    UnknownFormat(String),
    #[error("a terrain of {0} x {1} samples; 2 to {LARGEST_SIDE} a side can be held")]
    Size(u64, u64),
    #[error("`{0}` does not say how far its samples are apart: give `cell_m`")]
    NoCellSize(String),
    #[error("cells of {0:e} x {1:e} m; each side is from {least:e} to {most:e} m", least = CELL_SIDES_M.start(), most = CELL_SIDES_M.end())]
    CellSize(f64, f64),
    #[error("the sample at column {column}, row {row} has no data ({count} have none in all)")]
    NoData { column: u32, row: u32, count: usize },
    #[error("no sample of this terrain has data")]
    NothingKnown,
    #[error("the height at column {column}, row {row} is {height_m} m, which no kernel can work with")]
    NotFinite { column: u32, row: u32, height_m: f32 },
    #[error("the crop {0:?} (column, row, columns, rows) does not lie in a terrain of {1} x {2} samples")]
    Crop((u32, u32, u32, u32), u32, u32),
    #[error("{0}")]
    Parameter(String),
}

impl TerrainError {
    /// The field of the terrain that is at fault, if it is one.
    pub fn field(&self) -> Option<&'static str> {
        match self {
            TerrainError::Unreadable { .. } | TerrainError::BadFile { .. } | TerrainError::UnknownFormat(_) => {
                Some("file")
            }
            TerrainError::NoCellSize(_) => Some("file"),
            TerrainError::Size(..) => Some("size"),
            TerrainError::CellSize(..) => Some("cell_m"),
            TerrainError::Crop(..) => Some("crop"),
            _ => None,
        }
    }

    /// What the user can do about it, where that is not plain from the message.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            TerrainError::Size(..) => Some("crop or resample the terrain, or use one with more samples"),
            TerrainError::NoData { .. } => Some("`nodata: Fill(0)` or `nodata: Interpolate` fills the gaps"),
            TerrainError::NotFinite { .. } => {
                Some("`nodata: Interpolate` fills NaN; infinite heights need a cleaned file")
            }
            _ => None,
        }
    }
}

impl HeightField {
    /// Makes or reads the terrain of a scene; relative paths start at `folder`.
    pub fn load(terrain: &Terrain, folder: &Path) -> Result<Self, TerrainError> {
        let field = match terrain {
            Terrain::Dem(dem) => load_dem(dem, folder)?,
            Terrain::Noise(spec) => {
                check_extent(spec.size, spec.cell_m.xy())?;
                noise::generate(spec)?
            }
            Terrain::Shape(spec) => {
                check_extent(spec.size, spec.cell_m.xy())?;
                shapes::generate(spec)?
            }
        };
        match field.heights_m.iter().position(|height| !height.is_finite() || height.abs() > 1e9) {
            None => Ok(field),
            Some(at) => {
                let (column, row) = (at as u32 % field.size.x, at as u32 / field.size.x);
                Err(TerrainError::NotFinite { column, row, height_m: field.heights_m[at] })
            }
        }
    }

    pub fn height_m(&self, column: u32, row: u32) -> f32 {
        self.heights_m[(row * self.size.x + column) as usize]
    }
}

/// What single precision can work with, with room for products of two and for the largest terrain.
const CELL_SIDES_M: std::ops::RangeInclusive<f64> = 1e-6..=1e7;

fn check_extent(size: (u32, u32), cell_m: (f64, f64)) -> Result<(), TerrainError> {
    if !(2..=LARGEST_SIDE).contains(&size.0) || !(2..=LARGEST_SIDE).contains(&size.1) {
        return Err(TerrainError::Size(size.0.into(), size.1.into()));
    }
    if ![cell_m.0, cell_m.1].iter().all(|side_m| CELL_SIDES_M.contains(side_m)) {
        return Err(TerrainError::CellSize(cell_m.0, cell_m.1));
    }
    Ok(())
}

fn load_dem(dem: &Dem, folder: &Path) -> Result<HeightField, TerrainError> {
    let path = folder.join(&dem.file);
    let shown = path.display().to_string();
    let file = files::open(&path)?;
    let cell_m = dem.cell_m.map(|cell| cell.xy()).or(file.cell_m).ok_or(TerrainError::NoCellSize(shown.clone()))?;
    check_extent(file.size, cell_m)?;
    let (offset, scale) = match (dem.height_m, file.full_scale) {
        (None, _) => (dem.height_offset_m, dem.height_scale_m),
        (Some((low, high)), Some(full)) => (low, (high - low) / full),
        (Some(_), None) => {
            return Err(TerrainError::Parameter(format!(
                "`height_m` scales integer samples, but `{shown}` holds floating point heights"
            )));
        }
    };
    let nodata_value = dem.nodata_value.or(file.nodata_value);
    let height = |value: f64| match nodata_value {
        Some(none) if value == none => f32::NAN,
        _ => ((offset + scale * value) * dem.vertical_scale) as f32,
    };
    let window = Window::new(dem.crop, file.size)?;
    let mut grid = Grid { size: window.size, cell_m, heights_m: vec![f32::NAN; window.samples()] };
    let mut put = |column: u32, row: u32, values: &[f64]| window.put(&mut grid.heights_m, column, row, values, height);
    (file.samples)(&mut put).map_err(|what| files::bad(&path, &what))?;
    nodata::apply(&mut grid.heights_m, grid.size, dem.nodata, dem.vertical_scale)?;
    if let Some(size) = dem.resample {
        check_extent(size, cell_m)?;
        grid = grid.resample(size);
    }
    Ok(HeightField { size: grid.size.into(), cell_m: grid.cell_m.into(), heights_m: grid.heights_m })
}

/// The part of a file that is kept.
struct Window {
    /// Column and row of its first sample.
    first: (u32, u32),
    size: (u32, u32),
}

impl Window {
    fn new(crop: Option<(u32, u32, u32, u32)>, whole: (u32, u32)) -> Result<Self, TerrainError> {
        let Some(crop) = crop else { return Ok(Self { first: (0, 0), size: whole }) };
        let (column, row, columns, rows) = crop;
        let fits = |start: u32, length: u32, whole: u32| {
            length >= 2 && start.checked_add(length).is_some_and(|end| end <= whole)
        };
        match fits(column, columns, whole.0) && fits(row, rows, whole.1) {
            true => Ok(Self { first: (column, row), size: (columns, rows) }),
            false => Err(TerrainError::Crop(crop, whole.0, whole.1)),
        }
    }

    fn samples(&self) -> usize {
        self.size.0 as usize * self.size.1 as usize
    }

    /// Keeps what is in the window of some samples side by side.
    fn put(&self, heights_m: &mut [f32], column: u32, row: u32, values: &[f64], height: impl Fn(f64) -> f32) {
        let Some(row) = row.checked_sub(self.first.1).filter(|&row| row < self.size.1) else { return };
        let start = row as usize * self.size.0 as usize;
        let kept = &mut heights_m[start..start + self.size.0 as usize];
        // of the samples those from the window's first column on, and of the window what is from their first column on
        let values = values.iter().skip(self.first.0.saturating_sub(column) as usize);
        let kept = kept.iter_mut().skip(column.saturating_sub(self.first.0) as usize);
        kept.zip(values).for_each(|(kept, &value)| *kept = height(value));
    }
}

/// Heights while they are still being resampled.
struct Grid {
    size: (u32, u32),
    cell_m: (f64, f64),
    heights_m: Vec<f32>,
}

impl Grid {
    /// Bilinear; the first and last samples of each side stay where they are.
    fn resample(self, size: (u32, u32)) -> Self {
        let (columns, rows) = self.size;
        let step = |from: u32, to: u32| f64::from(from - 1) / f64::from(to - 1);
        let (step_x, step_y) = (step(columns, size.0), step(rows, size.1));
        let height = |column: u32, row: u32| f64::from(self.heights_m[(row * columns + column) as usize]);
        let mut heights_m = Vec::with_capacity(size.0 as usize * size.1 as usize);
        for row in 0..size.1 {
            let y = f64::from(row) * step_y;
            let top = (y as u32).min(rows - 2);
            let v = y - f64::from(top);
            for column in 0..size.0 {
                let x = f64::from(column) * step_x;
                let left = (x as u32).min(columns - 2);
                let u = x - f64::from(left);
                let along = |row| height(left, row) * (1.0 - u) + height(left + 1, row) * u;
                heights_m.push((along(top) * (1.0 - v) + along(top + 1) * v) as f32);
            }
        }
        Self { size, cell_m: (self.cell_m.0 * step_x, self.cell_m.1 * step_y), heights_m }
    }
}
