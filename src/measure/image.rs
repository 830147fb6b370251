//! Image error of the shaded picture against the shaded ground truth.

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
