//! Height sources: every file format and policy, exact shapes, seeds.

mod common;

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, UVec2};
use lodlab::experiment::diagnostic::Source;
use lodlab::experiment::scene::{Surface, Terrain};
use lodlab::experiment::tree::Node;
use lodlab::ground::{Ground, Samples};
use lodlab::terrain::{HeightField, TerrainError};
use proptest::prelude::*;
use tiff::encoder::{Compression, Predictor, TiffEncoder, colortype};
use tiff::tags::Tag;

fn load(text: &str, folder: &Path) -> Result<HeightField, TerrainError> {
    let terrain: Terrain =
        Node::read(&Source::new("test", text)).unwrap().parse().unwrap_or_else(|error| panic!("{error}"));
    HeightField::load(&terrain, folder)
}

const SIZE: (u32, u32) = (37, 21);

fn sample(at: u32) -> i32 {
    (at * 7919 % 3001) as i32 - 500
}

fn expect(field: &HeightField) {
    assert_eq!(field.size, UVec2::from(SIZE));
    for (at, height) in field.heights_m.iter().enumerate() {
        assert_eq!(*height, sample(at as u32) as f32, "sample {at}");
    }
}

#[test]
fn geotiff_of_every_type_and_compression() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dem.tif");
    macro_rules! check {
        ($color:ty, $sample:ty, $compression:expr, $predictor:expr) => {{
            let values: Vec<$sample> = (0..SIZE.0 * SIZE.1).map(|at| sample(at) as $sample).collect();
            let mut encoder =
                TiffEncoder::new(std::fs::File::create(&path).unwrap()).unwrap().with_compression($compression);
            encoder = encoder.with_predictor($predictor);
            let mut image = encoder.new_image::<$color>(SIZE.0, SIZE.1).unwrap();
            image.encoder().write_tag(Tag::ModelPixelScaleTag, &[30.0f64, 25.0, 0.0][..]).unwrap();
            image.rows_per_strip(5).unwrap();
            image.write_data(&values).unwrap();
            let field = load("Dem(file: \"dem.tif\")", folder.path()).unwrap();
            expect(&field);
            assert_eq!(field.cell_m, DVec2::new(30.0, 25.0));
        }};
    }
    macro_rules! check_unsigned {
        ($color:ty, $sample:ty, $compression:expr) => {{
            let values: Vec<$sample> = (0..SIZE.0 * SIZE.1).map(|at| (sample(at) + 500) as $sample).collect();
            let mut encoder =
                TiffEncoder::new(std::fs::File::create(&path).unwrap()).unwrap().with_compression($compression);
            encoder.new_image::<$color>(SIZE.0, SIZE.1).unwrap().write_data(&values).unwrap();
            expect(&load("Dem(file: \"dem.tif\", cell_m: 30, height_offset_m: -500)", folder.path()).unwrap());
        }};
    }
    for compression in [Compression::Uncompressed, Compression::Lzw, Compression::Deflate(Default::default())] {
        check!(colortype::GrayI16, i16, compression, Predictor::None);
        check_unsigned!(colortype::Gray16, u16, compression);
        check_unsigned!(colortype::Gray32, u32, compression);
        check!(colortype::GrayI32, i32, compression, Predictor::None);
        check!(colortype::Gray32Float, f32, compression, Predictor::None);
        check!(colortype::Gray64Float, f64, compression, Predictor::None);
        check!(colortype::GrayI16, i16, compression, Predictor::Horizontal);
    }
}

/// A file of four tiles, the right and lower ones half outside the picture, written by hand.
#[test]
fn geotiff_in_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let (width, height, side) = (24u32, 20u32, 16u32);
    let tile_bytes = side * side * 2;
    let data = 8 + 2 + 12 * 10 + 4 + 32;
    let entries = [
        (256u16, 3u16, 1u32, width),
        (257, 3, 1, height),
        (258, 3, 1, 16),
        (259, 3, 1, 1),
        (262, 3, 1, 1),
        (277, 3, 1, 1),
        (322, 3, 1, side),
        (323, 3, 1, side),
        (324, 4, 4, data - 32),
        (325, 4, 4, data - 16),
    ];
    let mut bytes = common::tiff(&entries);
    (0..4).for_each(|tile| bytes.extend((data + tile * tile_bytes).to_le_bytes()));
    (0..4).for_each(|_| bytes.extend(tile_bytes.to_le_bytes()));
    for tile in 0..4u32 {
        for at in 0..side * side {
            let (x, y) = (tile % 2 * side + at % side, tile / 2 * side + at / side);
            bytes.extend(((100 * y + x) as u16).to_le_bytes());
        }
    }
    std::fs::write(folder.path().join("tiles.tif"), bytes).unwrap();
    let field = load("Dem(file: \"tiles.tif\", cell_m: 30)", folder.path()).unwrap();
    assert_eq!(field.size, UVec2::new(width, height));
    for y in 0..height {
        for x in 0..width {
            assert_eq!(field.height_m(x, y), (100 * y + x) as f32);
        }
    }
}

/// A strip of more bytes than the `tiff` crate reads by itself, in a file that is mostly a hole.
#[test]
fn large_strips_are_read_and_the_limit_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.tif");
    let strip = |(columns, rows): (u32, u32), bits: u32| {
        let (floating, bytes) = (3, columns.wrapping_mul(rows).wrapping_mul(bits / 8));
        let entries = [
            (256u16, 4u16, 1u32, columns),
            (257, 4, 1, rows),
            (258, 3, 1, bits),
            (259, 3, 1, 1),
            (262, 3, 1, 1),
            (273, 4, 1, 4096),
            (277, 3, 1, 1),
            (278, 4, 1, rows),
            (279, 4, 1, bytes),
            (339, 3, 1, floating),
        ];
        std::fs::write(&path, common::tiff(&entries)).unwrap();
        File::options().write(true).open(&path).unwrap().set_len(4096 + u64::from(bytes)).unwrap();
    };
    strip((16_384, 4_100), 32);
    let cropped = load("Dem(file: \"large.tif\", cell_m: 1, crop: (9000, 4000, 2, 2))", folder.path()).unwrap();
    assert_eq!((cropped.size, cropped.heights_m), (UVec2::splat(2), vec![0.0; 4]));
    strip((16_384, 16_384), 64);
    let refused = load("Dem(file: \"large.tif\", cell_m: 1)", folder.path()).unwrap_err().to_string();
    assert!(refused.contains("strips or tiles of 2147483648 bytes; at most 1073741824"), "{refused}");
}

#[test]
fn geographic_geotiff_has_metres_of_its_latitude_and_its_own_nodata() {
    let folder = tempfile::tempdir().unwrap();
    let mut encoder = TiffEncoder::new(std::fs::File::create(folder.path().join("dem.tif")).unwrap()).unwrap();
    let mut image = encoder.new_image::<colortype::GrayI16>(3, 3).unwrap();
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &[0.001f64, 0.001, 0.0][..]).unwrap();
    tags.write_tag(Tag::ModelTiepointTag, &[0.0f64, 0.0, 0.0, 10.0, 60.001, 0.0][..]).unwrap();
    // one key: the model is geographic
    tags.write_tag(Tag::GeoKeyDirectoryTag, &[1u16, 1, 0, 1, 1024, 0, 1, 2][..]).unwrap();
    tags.write_tag(Tag::GdalNodata, "-9999").unwrap();
    image.write_data(&[1i16, 1, 1, 1, -9999, 1, 1, 1, 1]).unwrap();
    let refused = load("Dem(file: \"dem.tif\")", folder.path()).unwrap_err();
    assert!(matches!(refused, TerrainError::NoData { column: 1, row: 1, count: 1 }), "{refused}");
    let filled = load("Dem(file: \"dem.tif\", nodata: Fill(7))", folder.path()).unwrap();
    assert_eq!(filled.height_m(1, 1), 7.0);
    let field = load("Dem(file: \"dem.tif\", nodata: Interpolate)", folder.path()).unwrap();
    assert_eq!(field.height_m(1, 1), 1.0);
    // the middle row is at 60 degrees, where a degree of longitude is half one of latitude
    let degree = 6_371_008.8f64.to_radians();
    assert!((field.cell_m - DVec2::new(0.0005, 0.001) * degree).length() < 1e-6, "{}", field.cell_m);
}

#[test]
fn srtm_tiles_plain_and_zipped() {
    let folder = tempfile::tempdir().unwrap();
    for side in [1201usize, 3601] {
        let mut bytes: Vec<u8> = (0..side * side).flat_map(|at| ((at % 3000) as i16).to_be_bytes()).collect();
        bytes[2..4].copy_from_slice(&i16::MIN.to_be_bytes());
        std::fs::write(folder.path().join("N47W122.hgt"), &bytes).unwrap();
        let mut zip = zip::ZipWriter::new(std::fs::File::create(folder.path().join("N47W122.hgt.zip")).unwrap());
        zip.start_file("N47W122.hgt", zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&bytes).unwrap();
        zip.finish().unwrap();
        for name in ["N47W122.hgt", "N47W122.hgt.zip"] {
            let field = load(&format!("Dem(file: \"{name}\", nodata: Fill(-1))"), folder.path()).unwrap();
            assert_eq!((field.size.x as usize, field.height_m(1, 0), field.height_m(5, 0)), (side, -1.0, 5.0));
            let degree = 6_371_008.8f64.to_radians() / (side - 1) as f64;
            assert!((field.cell_m.y - degree).abs() < 1e-6);
            assert!((field.cell_m.x - degree * 47.5f64.to_radians().cos()).abs() < 1e-6);
        }
    }
}

#[test]
fn png_of_8_and_16_bits_and_npy() {
    let folder = tempfile::tempdir().unwrap();
    image::GrayImage::from_fn(4, 3, |x, y| image::Luma([(x * 60 + y) as u8]))
        .save(folder.path().join("eight.png"))
        .unwrap();
    let sixteen = image::ImageBuffer::from_fn(4, 3, |x, y| image::Luma([(x * 20_000 + y) as u16]));
    sixteen.save(folder.path().join("sixteen.png")).unwrap();
    let eight = load("Dem(file: \"eight.png\", cell_m: 10, height_m: (100, 355))", folder.path()).unwrap();
    assert_eq!((eight.height_m(0, 0), eight.height_m(3, 2)), (100.0, 282.0));
    let sixteen =
        load("Dem(file: \"sixteen.png\", cell_m: (10, 20), height_offset_m: 5, height_scale_m: 0.5)", folder.path())
            .unwrap();
    assert_eq!((sixteen.height_m(3, 1), sixteen.cell_m.y), (5.0 + 0.5 * 60_001.0, 20.0));

    let mut bytes = Vec::new();
    let mut writer = npyz::WriterBuilder::begin_nd(npyz::WriterBuilder::writer(
        npyz::WriterBuilder::shape(npyz::WriterBuilder::default_dtype(npyz::WriteOptions::<f64>::new()), &[21, 37]),
        &mut bytes,
    ))
    .unwrap();
    writer.extend((0..SIZE.0 * SIZE.1).map(|at| f64::from(sample(at)))).unwrap();
    writer.finish().unwrap();
    std::fs::write(folder.path().join("dem.npy"), bytes).unwrap();
    expect(&load("Dem(file: \"dem.npy\", cell_m: 1)", folder.path()).unwrap());
}

#[test]
fn crop_resample_and_scale_keep_places() {
    let folder = tempfile::tempdir().unwrap();
    image::ImageBuffer::from_fn(9, 5, |x, y| image::Luma([(x * 100 + y * 10) as u16]))
        .save(folder.path().join("dem.png"))
        .unwrap();
    let field = load(
        "Dem(file: \"dem.png\", cell_m: 10, crop: (2, 1, 5, 3), resample: (9, 5), vertical_scale: 2)",
        folder.path(),
    )
    .unwrap();
    assert_eq!((field.size, field.cell_m), (UVec2::new(9, 5), DVec2::splat(5.0)));
    // a plane stays a plane
    for y in 0..5 {
        for x in 0..9 {
            let expected = 2.0 * (100.0 * (2.0 + f64::from(x) / 2.0) + 10.0 * (1.0 + f64::from(y) / 2.0));
            assert!((f64::from(field.height_m(x, y)) - expected).abs() < 1e-3);
        }
    }
}

#[test]
fn shapes_are_what_they_say_and_seeds_repeat() {
    let shape = |kind: &str| {
        load(&format!("Shape(kind: {kind}, size: (9, 7), height_m: (10, 20), period_cells: 4)"), Path::new("")).unwrap()
    };
    assert!(shape("Flat").heights_m.iter().all(|&height| height == 10.0));
    assert_eq!((shape("Ramp").height_m(0, 3), shape("Ramp").height_m(8, 3)), (10.0, 20.0));
    assert_eq!(shape("Spike").heights_m.iter().filter(|&&height| height == 20.0).count(), 1);
    assert_eq!((shape("Cliff").height_m(4, 0), shape("Cliff").height_m(5, 0)), (10.0, 20.0));
    assert_eq!((shape("Checkerboard").height_m(0, 0), shape("Checkerboard").height_m(2, 0)), (10.0, 20.0));
    assert_eq!((shape("Sine").height_m(1, 1), shape("GaussianHill").height_m(4, 3)), (20.0, 20.0));
    for kind in ["Fbm", "Ridged", "Billow", "Hybrid", "DomainWarped"] {
        let noise =
            |seed: u32| load(&format!("Noise(kind: {kind}, seed: {seed}, size: (33, 17))"), Path::new("")).unwrap();
        assert_eq!(noise(5).heights_m, noise(5).heights_m);
        assert_ne!(noise(5).heights_m, noise(6).heights_m);
        let (low, high) = Samples::new(Arc::new(noise(5)), Surface::Triangles).range_m();
        assert!(high > low + 10.0, "{kind} is flat");
    }
    let octaves = |octaves: u32| {
        load(&format!("Noise(kind: Fbm, persistence: 0, octaves: {octaves}, size: (9, 9))"), Path::new("")).unwrap()
    };
    assert_eq!(octaves(1).heights_m, octaves(8).heights_m, "octaves without amplitude");
}

proptest! {
    /// Both surfaces go through their samples and stay between their neighbours.
    #[test]
    fn the_surface_stays_within_its_cell(seed in 0u64..1000, x in 0.0..1.0f64, y in 0.0..1.0f64) {
        let field = load(&format!("Noise(kind: Ridged, seed: {seed}, size: (8, 6), cell_m: (10, 20))"), Path::new("")).unwrap();
        let field = Arc::new(field);
        let ground = |surface| Samples::new(field.clone(), surface);
        let lattice = ground(Surface::Triangles).lattice();
        let position = lattice.extent_m() * DVec2::new(x, y);
        let at = lattice.sample_from_world(position).floor().as_uvec2().min(field.size - 2);
        let around = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| f64::from(field.height_m(at.x + dx, at.y + dy)));
        for surface in [Surface::Triangles, Surface::Bilinear] {
            let height = ground(surface).surface_at(position.extend(0.0)).z;
            let (low, high) = around.iter().fold((f64::MAX, f64::MIN), |(low, high), &h| (low.min(h), high.max(h)));
            prop_assert!((low - 1e-9..=high + 1e-9).contains(&height));
        }
        let corner = lattice.world_from_sample(at.as_dvec2()).extend(1e4);
        prop_assert!((ground(Surface::Triangles).above_m(corner) - (1e4 - around[0])).abs() < 1e-9);
    }
}

/// A seed is part of an experiment that somebody publishes: it gives the same heights in every version.
#[test]
fn seeds_give_the_same_terrain_for_good() {
    let frozen: [(&str, [u32; 3]); 5] = [
        ("Fbm", [0x43fe_cad8, 0x43b8_da4b, 0x43c1_3ed1]),
        ("Ridged", [0x4437_297a, 0x4414_e688, 0x43c5_65bb]),
        ("Billow", [0x437a_7415, 0x439e_d267, 0x4387_986e]),
        ("Hybrid", [0x43f7_1453, 0x4348_ac08, 0x43a0_5bba]),
        ("DomainWarped", [0x4414_242b, 0x43f9_19f0, 0x440f_ce58]),
    ];
    for (kind, expected) in frozen {
        let text =
            format!("Noise(kind: {kind}, seed: 7, size: (5, 4), cell_m: 30, height_m: (0, 1000), wavelength_m: 300)");
        let heights_m = load(&text, Path::new("")).unwrap().heights_m;
        assert_eq!([0, 7, 19].map(|at: usize| heights_m[at].to_bits()), expected, "{kind}");
    }
}
