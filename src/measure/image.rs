//! Image error of the shaded picture against the shaded ground truth.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Column, Figures, Info, Kind, Known, Measure, Measured, Seen, Show, Sums, Tally, read_as};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::plan::product;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "Image",
    summary: "PSNR and SSIM of the shaded picture against the shaded ground truth; the worst frame counts",
    version: 1,
    parameters: schema::<Image>,
    read: read_as::<Image>,
    figures: &[
        Known::new(
            "psnr",
            "dB",
            Kind::Likeness,
            "peak signal-to-noise ratio of the worst frame; none where all pictures are equal",
        ),
        Known::new("ssim", "", Kind::Likeness, "mean structural similarity of the worst frame, 1 for equal pictures"),
        Known::new("equal_pictures", "", Kind::Other, "1 if all pictures are equal to those of the truth"),
    ],
    columns: &[Column { heading: "psnr dB", figure: "psnr", show: Show::NumberUnless("equal_pictures") }],
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Image {}

impl Measure for Image {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        let picture: product::Picture<BufferId> = chain.latest()?;
        let (columns, rows) = chain.data.scene.viewport;
        chain.check_kind(picture.pixels, Elem::U32, &[rows, columns])?;
        Ok(vec![picture.pixels])
    }

    fn wants_truth(&self) -> bool {
        true
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Worst::default())
    }
}

/// The worst frames.
#[derive(Default)]
struct Worst {
    psnr_db: Option<f64>,
    ssim: Option<f64>,
    has_equal: bool,
    picture: Option<super::Picture>,
}

impl Sums for Worst {
    fn of_frame(&self, seen: &Seen) -> Self {
        let offered = seen.plan.products.latest::<product::Picture<BufferId>>();
        let (Some(truth), Some(offered)) = (seen.truth, offered) else { return Self::default() };
        let pixels: Vec<u32> = seen.read(offered.pixels);
        let width = seen.data.scene.viewport.0;
        let drawn = Picture { width: width as usize, pixels: &pixels };
        let exact = Picture { pixels: &truth.colour, ..drawn };
        let rgb = || pixels.iter().flat_map(|&pixel| [0, 1, 2].map(|at| channel(pixel, at) as u8)).collect();
        let picture = seen.is_pictured().then(|| super::Picture { kind: "image", width, rgb: rgb() });
        let psnr_db = psnr_db(drawn, exact);
        Self { psnr_db, ssim: Some(ssim(drawn, exact)), has_equal: psnr_db.is_none(), picture }
    }

    fn add(&mut self, frame: Self) {
        let least = |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).reduce(f64::min);
        self.psnr_db = least(self.psnr_db, frame.psnr_db);
        self.ssim = least(self.ssim, frame.ssim);
        self.has_equal |= frame.has_equal;
        self.picture = self.picture.take().or(frame.picture);
    }

    fn measured(&self) -> Vec<Measured> {
        // equal pictures have no ratio and are better than any
        let equal = f64::from(self.has_equal && self.psnr_db.is_none());
        vec![
            Measured::new("psnr", self.psnr_db, "dB"),
            Measured::new("ssim", self.ssim, ""),
            Measured::new("equal_pictures", equal, ""),
        ]
    }

    fn figures(self) -> Figures {
        Figures { measured: self.measured(), pictures: self.picture.into_iter().collect(), warnings: Vec::new() }
    }
}

/// A picture, red in the lowest byte of each pixel.
#[derive(Clone, Copy)]
pub struct Picture<'a> {
    pub width: usize,
    pub pixels: &'a [u32],
}

/// Peak signal-to-noise ratio over the three channels in dB; `None` for equal pictures, whose ratio is infinite.
pub fn psnr_db(a: Picture, b: Picture) -> Option<f64> {
    let square = |(a, b): (&u32, &u32)| (0..3).map(|c| f64::from(channel(*a, c) - channel(*b, c)).powi(2)).sum::<f64>();
    let sum: f64 = a.pixels.iter().zip(b.pixels).map(square).sum();
    let mean = sum / (3 * a.pixels.len().max(1)) as f64;
    (mean > 0.0).then(|| 10.0 * (255.0 * 255.0 / mean).log10())
}

fn channel(pixel: u32, channel: u32) -> i32 {
    (pixel >> (8 * channel) & 255) as i32
}

/// Mean structural similarity of the luminance: Gaussian window of 11 x 11 with sigma 1.5, K1 = 0.01,
/// K2 = 0.03 (Wang, Bovik, Sheikh, Simoncelli 2004). 1 for equal pictures.
pub fn ssim(a: Picture, b: Picture) -> f64 {
    let (x, y) = (luminance(a), luminance(b));
    let product = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(p, q)| p * q).collect::<Vec<f64>>();
    let blurred = |values: &[f64]| blur(values, a.width);
    let (mx, my) = (blurred(&x), blurred(&y));
    let (xx, yy, xy) = (blurred(&product(&x, &x)), blurred(&product(&y, &y)), blurred(&product(&x, &y)));
    let (c1, c2) = ((0.01f64 * 255.0).powi(2), (0.03f64 * 255.0).powi(2));
    let local = (0..x.len()).map(|i| {
        let (mx, my) = (mx[i], my[i]);
        let (vx, vy, cov) = (xx[i] - mx * mx, yy[i] - my * my, xy[i] - mx * my);
        ((2.0 * mx * my + c1) * (2.0 * cov + c2)) / ((mx * mx + my * my + c1) * (vx + vy + c2))
    });
    local.sum::<f64>() / x.len().max(1) as f64
}

/// Rec. 709 weights on the stored values.
fn luminance(picture: Picture) -> Vec<f64> {
    let weigh =
        |&pixel: &u32| [0.2126, 0.7152, 0.0722].iter().zip(0..).map(|(w, c)| w * f64::from(channel(pixel, c))).sum();
    picture.pixels.iter().map(weigh).collect()
}

/// Gaussian of 11 taps along both axes; at the border the weights that are left are scaled to 1.
fn blur(values: &[f64], width: usize) -> Vec<f64> {
    const REACH: isize = 5;
    let weight = |offset: isize| (-((offset * offset) as f64) / (2.0 * 1.5 * 1.5)).exp();
    let weights: Vec<f64> = (-REACH..=REACH).map(weight).collect();
    let height = values.len() / width.max(1);
    let along = |values: &[f64], length: usize, lines: usize, step: usize, jump: usize| {
        let mut out = vec![0.0; values.len()];
        for line in 0..lines {
            for at in 0..length {
                let (mut sum, mut total) = (0.0, 0.0);
                for offset in -REACH..=REACH {
                    let Some(other) = at.checked_add_signed(offset).filter(|&other| other < length) else { continue };
                    let weight = weights[(offset + REACH) as usize];
                    sum += weight * values[line * jump + other * step];
                    total += weight;
                }
                out[line * jump + at * step] = sum / total;
            }
        }
        out
    };
    along(&along(values, width, height, 1, width), height, width, width, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(value: impl Fn(usize) -> u32, width: usize) -> Vec<u32> {
        (0..width * width).map(|at| value(at) * 0x01_01_01).collect()
    }

    fn picture(pixels: &[u32], width: usize) -> Picture<'_> {
        Picture { width, pixels }
    }

    #[test]
    fn the_ratio_is_that_of_the_definition() {
        let (black, ten) = (grey(|_| 0, 8), grey(|_| 10, 8));
        assert_eq!(psnr_db(picture(&black, 8), picture(&black, 8)), None);
        // every channel is off by 10: 20 log10(255 / 10)
        let psnr = psnr_db(picture(&black, 8), picture(&ten, 8)).unwrap();
        assert!((psnr - 28.130803608679105).abs() < 1e-12, "{psnr}");
        // one pixel of 64 off by 255 in one channel of three: 10 log10(3 * 64)
        let mut one = black.clone();
        one[5] = 255;
        let psnr = psnr_db(picture(&black, 8), picture(&one, 8)).unwrap();
        assert!((psnr - 10.0 * 192.0f64.log10()).abs() < 1e-12, "{psnr}");
    }

    #[test]
    fn similarity_falls_with_structure_and_not_with_a_little_brightness() {
        let stripes = grey(|at| if at % 4 < 2 { 60 } else { 180 }, 32);
        let brighter = grey(|at| if at % 4 < 2 { 64 } else { 184 }, 32);
        let shifted = grey(|at| if at % 4 < 2 { 180 } else { 60 }, 32);
        let to = |other: &[u32]| ssim(picture(&stripes, 32), picture(other, 32));
        assert!((to(&stripes) - 1.0).abs() < 1e-12);
        assert!(to(&brighter) > 0.99, "{}", to(&brighter));
        // stripes and gaps exchanged: the covariance is the variance turned over
        assert!(to(&shifted) < -0.9, "{}", to(&shifted));
        // two flat pictures: only the means count, and no variance, in the formula of Wang et al.
        let (a, b) = (grey(|_| 100, 16), grey(|_| 50, 16));
        let flat = ssim(picture(&a, 16), picture(&b, 16));
        let expected = (2.0 * 100.0 * 50.0 + 6.5025) / (100.0 * 100.0 + 50.0 * 50.0 + 6.5025);
        assert!((flat - expected).abs() < 1e-6, "{flat} is not {expected}");
    }
}
