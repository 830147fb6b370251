//! How much memory a terrain takes while it is read. (A file of its own, since it counts what the whole process allocates.)

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs::File;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use lodlab::experiment::diagnostic::Source;
use lodlab::experiment::scene::Terrain;
use lodlab::experiment::tree::Node;
use lodlab::terrain::HeightField;
use tiff::encoder::{TiffEncoder, colortype};

struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: the system's allocator does the work, and counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        MOST.fetch_max(NOW.fetch_add(layout.size(), SeqCst) + layout.size(), SeqCst);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), SeqCst);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

const SIDE: u32 = 1201;
const SAMPLES: usize = SIDE as usize * SIDE as usize;

/// One file of each format, and for TIFF in many strips and in one.
fn write_files(folder: &Path) {
    let grey = image::ImageBuffer::from_fn(SIDE, SIDE, |x, y| image::Luma([(x * 20 + y) as u16]));
    grey.save(folder.join("grey.png")).unwrap();
    for (name, rows_per_strip) in [("strips.tif", 16), ("strip.tif", SIDE)] {
        let mut encoder = TiffEncoder::new(File::create(folder.join(name)).unwrap()).unwrap();
        let mut image = encoder.new_image::<colortype::Gray32Float>(SIDE, SIDE).unwrap();
        image.rows_per_strip(rows_per_strip).unwrap();
        image.write_data(&vec![1.0f32; SAMPLES]).unwrap();
    }
    std::fs::write(folder.join("N47W122.hgt"), vec![0; 2 * SAMPLES]).unwrap();
    for (name, kind) in [("single.npy", "f4"), ("double.npy", "f8")] {
        let header = format!("{{'descr': '<{kind}', 'fortran_order': False, 'shape': ({SIDE}, {SIDE})}}\n");
        let data = vec![0; SAMPLES * if kind == "f4" { 4 } else { 8 }];
        let length = (header.len() as u16).to_le_bytes();
        std::fs::write(folder.join(name), [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &data].concat())
            .unwrap();
    }
}

#[test]
fn a_file_takes_twice_the_heights_at_most() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    for (file, fields) in [
        ("grey.png", ""),
        ("strips.tif", ""),
        ("strip.tif", ""),
        ("N47W122.hgt", ""),
        ("single.npy", ""),
        ("double.npy", ""),
        ("double.npy", ", crop: (1, 1, 1200, 1200)"),
        ("double.npy", ", nodata_value: 7, nodata: Interpolate, vertical_scale: 2"),
    ] {
        let text = format!("Dem(file: \"{file}\", cell_m: 30{fields})");
        let terrain: Terrain = Node::read(&Source::new("test", text)).unwrap().parse().unwrap();
        let before = NOW.load(SeqCst);
        MOST.store(before, SeqCst);
        let field = HeightField::load(&terrain, folder.path()).unwrap();
        let most = MOST.load(SeqCst) - before;
        let heights = 4 * field.heights_m.len();
        // rows that are in hand, and what decoders keep
        let slack = heights / 10;
        assert!((heights..=2 * heights + slack).contains(&most), "{file}{fields}: {most} bytes for {heights}");
    }
}
